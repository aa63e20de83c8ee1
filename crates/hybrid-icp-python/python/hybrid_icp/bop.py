"""Refines result files of the BOP benchmark image by image, in a custom program.

Each image is an independent task, and equal input gives equal bytes:

    images = read_images("cosypose_ycbv-test.csv")
    refiner = DatasetRefiner("bop/ycbv", "test", Pipeline(), object_ids(images))
    lines = {}
    for scene_id, im_id, indices, rows in images:  # On any machine.
        refined, statuses, faults = refiner.refine(rows)
        lines.update(zip(indices, refined))
    write_results("refined_ycbv-test.csv", (lines[i] for i in sorted(lines)))

`hybrid_icp.ray.refine` does this on Ray, with retries and a journal.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from ._native import DatasetRefiner, read_images, result_header

__all__ = ["DatasetRefiner", "object_ids", "read_images", "result_header", "write_results"]


def object_ids(images: Iterable[tuple[int, int, list[int], str]]) -> list[int]:
    """Returns the ids of the objects in the rows.

    Parameters
    ----------
    images : iterable of (int, int, list of int, str)
        The rows by image, as `read_images` returns them.

    Returns
    -------
    list of int
        The ids in ascending order.
    """
    column = result_header().split(",").index("obj_id")
    lines = (line for *_, rows in images for line in rows.split("\n")[1:])
    return sorted({int(line.split(",")[column]) for line in lines})


def write_results(path: str | os.PathLike[str], lines: Iterable[str]) -> None:
    """Writes a result file completely or not at all.

    Parameters
    ----------
    path : str or os.PathLike
        The file to write.
    lines : iterable of str
        The rows in order, without line ends, as `DatasetRefiner.refine` returns them.
    """
    target = Path(path)
    prefix = f".{target.name}."
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=prefix, suffix=".tmp")
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
