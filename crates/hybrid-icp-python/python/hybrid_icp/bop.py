"""Result files of the BOP benchmark, image by image: the pieces of a refinement that an engine of your own drives.

Each image is a piece of work that depends on nothing else, and equal input gives equal bytes:

    images = read_images("cosypose_ycbv-test.csv")
    refiner = DatasetRefiner("bop/ycbv", "test", Pipeline(), object_ids(images))
    lines = {}
    for scene_id, im_id, indices, rows in images:  # On whatever machine.
        refined, statuses, faults = refiner.refine(rows)
        lines.update(zip(indices, refined))
    write_results("refined_ycbv-test.csv", (lines[i] for i in sorted(lines)))

`hybrid_icp.ray.refine` is this on Ray, with retries and a journal.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from ._native import DatasetRefiner, read_images, result_header

__all__ = ["DatasetRefiner", "object_ids", "read_images", "result_header", "write_results"]


def object_ids(images: Iterable[tuple[int, int, list[int], str]]) -> list[int]:
    """Ids of the objects that rows name.

    Parameters
    ----------
    images : iterable of (int, int, list of int, str)
        As `read_images` returns them.

    Returns
    -------
    list of int
        Ascending.
    """
    column = result_header().split(",").index("obj_id")
    return sorted({int(line.split(",")[column]) for *_, rows in images for line in rows.split("\n")[1:]})


def write_results(path: str | os.PathLike[str], lines: Iterable[str]) -> None:
    """Writes a result file, whole or not at all.

    Parameters
    ----------
    path : str or os.PathLike
        Where it goes.
    lines : iterable of str
        The rows in order, without line ends, as `DatasetRefiner.refine` returns them.
    """
    target = Path(path)
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".tmp")
    try:
        with os.fdopen(handle, "w", encoding="ascii", newline="\n") as file:
            file.write(result_header() + "\n")
            file.writelines(line + "\n" for line in lines)
            file.flush()
            os.fsync(file.fileno())
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, target)
    except BaseException:
        os.unlink(temporary)
        raise
