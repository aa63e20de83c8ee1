"""Refines a BOP result file on Ray, on a laptop or on a cluster.

The output has the bytes of `hybrid-icp bop refine --no-time`. The module requires the extra
``pip install 'hybrid_icp[ray]'``. `hybrid_icp` itself does not import Ray.

Rows are grouped by image, so that each image is decoded once, for any number of hypotheses. Actors
read the models once. Each task is a few images. The driver writes the results of tasks to a journal
next to the output. If a worker dies, Ray starts it again and repeats its task. If the driver dies,
the next run continues from the journal.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ray
import ray.data

from . import bop
from ._errors import InputError
from ._native import Pipeline

__all__ = ["refine"]

_Image = tuple[int, int, list[int], str]


class _Worker:
    """An actor that holds the models of a dataset and refines one image after the other."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        self._refiner = bop.DatasetRefiner(**arguments)

    def __call__(self, batch: dict[str, Any]) -> dict[str, Any]:
        done = []
        for task in batch["task"]:
            statuses: dict[str, int] = {}
            lines: list[str] = []
            faults: list[str] = []
            for rows in json.loads(task):
                refined, of_rows, broken = self._refiner.refine(rows)
                lines += refined
                faults += broken
                for status in of_rows:
                    statuses[status] = statuses.get(status, 0) + 1
            done.append(json.dumps({"lines": lines, "statuses": statuses, "faults": faults}))
        return {"place": batch["place"], "done": done}


def refine(
    dataset: str | os.PathLike[str],
    results: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    split: str = "test",
    pipeline: Pipeline | None = None,
    detections: str | os.PathLike[str] | None = None,
    mask: str = "visible",
    models: str | os.PathLike[str] | None = None,
    color: bool = True,
    sensor: str | None = None,
    rescore: str = "keep",
    workers: int | None = None,
    num_cpus: float = 0.5,
    rows_per_task: int = 256,
    limit: int | None = None,
    resume: bool = True,
    progress: Callable[[int, int], object] | None = None,
) -> dict[str, int]:
    """Refines every row of a result file on Ray.

    Call `ray.init` first to use a cluster. Otherwise Ray starts on this machine.

    Parameters
    ----------
    dataset : str or os.PathLike
        The folder of the dataset. Every worker reads it at this path.
    results : str or os.PathLike
        The result file: CSV, or Parquet with the same columns. In Parquet, R and t (mm) are lists
        of numbers or texts.
    output : str or os.PathLike
        The refined result file, with the rows in their order. During the run, the journal is next
        to it.
    split : str, optional
        The folder of the split.
    pipeline : Pipeline, optional
        The default is `Pipeline()`.
    detections : str or os.PathLike, optional
        Use the masks of a detections file instead of mask_visib.
    mask : {"visible", "none"}, optional
        Without detections: mask_visib, or all measured points in a box around the pose of each row.
    models : str or os.PathLike, optional
        Another folder of meshes: one of the dataset, such as "models_color", or a path that every
        worker can read.
    color : bool, optional
        Use the colors of the meshes and the images in rgb/ if both exist.
    sensor : str, optional
        The sensor of scenes with several, such as "cam1".
    rescore : {"keep", "mve", "confidence"}, optional
        The score of a row: its old score, 1 - MVE, or its confidence. With the last two, a row that
        did not reach the pipeline has the score 0.
    workers : int, optional
        Number of actors, with one thread each. The default is the number of CPUs of the cluster.
    num_cpus : float, optional
        CPUs that an actor reserves. With 1 and an actor on every CPU, the tasks that feed the
        actors could not run, and the actors would wait forever.
    rows_per_task : int, optional
        Minimum number of rows of a task. Images are never split. If a worker dies, this work is
        repeated.
    limit : int, optional
        Refine only the first rows.
    resume : bool, optional
        Continue from the journal of an interrupted run with the same input.
    progress : callable, optional
        Receives the number of finished rows and the number of all rows, after every task.

    Returns
    -------
    dict of str to int
        Number of rows by status.

    Raises
    ------
    InputError
        If a file of the dataset is damaged. The output is written nevertheless, and rows that need
        the file keep their poses.
    """
    pipeline = pipeline or Pipeline()
    path = Path(results)
    if path.suffix == ".parquet":
        path = _csv_of(path, Path(output))
    images = bop.read_images(path, limit=limit)
    tasks = list(_tasks(images, rows_per_task))
    arguments = {
        "dataset": os.path.abspath(dataset),
        "split": split,
        "pipeline": pipeline,
        "objects": bop.object_ids(images),
        "detections": None if detections is None else os.path.abspath(detections),
        "mask": mask,
        "models": None if models is None else os.fspath(models),
        "color": color,
        "sensor": sensor,
        "rescore": rescore,
    }
    settings = _digest(arguments, pipeline, tasks)
    journal = _Journal(Path(f"{os.fspath(output)}.journal"), settings, resume)
    total, count = sum(len(image[2]) for image in images), 0
    for place in journal.done:
        count += sum(len(image[2]) for image in tasks[place])
    missing = [place for place in range(len(tasks)) if place not in journal.done]
    if missing:
        if not ray.is_initialized():
            ray.init(log_to_driver=False, include_dashboard=False)
        workers = workers or max(1, int(ray.cluster_resources().get("CPU", 1)))
        items = [
            {"place": place, "task": json.dumps([image[3] for image in tasks[place]])}
            for place in missing
        ]
        blocks = min(len(items), 16 * workers)
        work = ray.data.from_items(items, override_num_blocks=blocks).map_batches(
            _Worker,
            fn_constructor_args=[arguments],
            batch_size=1,
            compute=ray.data.ActorPoolStrategy(size=min(workers, len(items))),
            # The defaults of Ray Data restart a dead actor and repeat its tasks without limit.
            num_cpus=num_cpus,
        )
        for item in work.iter_rows():
            journal.append(int(item["place"]), json.loads(item["done"]))
            count += sum(len(image[2]) for image in tasks[int(item["place"])])
            if progress is not None:
                progress(count, total)

    lines = [""] * total
    statuses: dict[str, int] = {}
    faults: list[str] = []
    for place, task in enumerate(tasks):
        done = journal.done[place]
        for index, line in zip((i for image in task for i in image[2]), done["lines"]):
            lines[index] = line
        for status, number in done["statuses"].items():
            statuses[status] = statuses.get(status, 0) + number
        faults += done["faults"]
    bop.write_results(output, lines)
    journal.remove()
    if faults:
        unusable = "1 file" if len(faults) == 1 else f"{len(faults)} files"
        raise InputError(
            f"{unusable} could not be used, the first: {faults[0]}; "
            f"all other rows are refined in {output}"
        )
    return statuses


def _tasks(images: list[_Image], rows_per_task: int) -> Iterator[list[_Image]]:
    """Yields the tasks, each a few images in order."""
    task: list[_Image] = []
    rows = 0
    for image in images:
        task.append(image)
        rows += len(image[2])
        if rows >= rows_per_task:
            yield task
            task, rows = [], 0
    if task:
        yield task


def _digest(arguments: dict[str, Any], pipeline: Pipeline, tasks: list[list[_Image]]) -> str:
    """Returns a digest of all inputs. A run continues only a journal with the same digest."""
    digest = hashlib.sha256()
    digest.update(repr([str(value) for value in arguments.values()]).encode())
    digest.update(repr(pipeline.__reduce__()[1]).encode())
    for task in tasks:
        for image in task:
            digest.update(repr(image).encode())
    return digest.hexdigest()


class _Journal:
    """The finished tasks, one JSON object per line. The first line has the digest of the input."""

    def __init__(self, path: Path, settings: str, resume: bool) -> None:
        self.done: dict[int, dict[str, Any]] = {}
        self._path = path
        kept = list(self._read(settings)) if resume and path.is_file() else []
        # The kept entries replace the journal at once, so that a kill at this point loses nothing.
        temporary = path.with_name(f".{path.name}.tmp")
        self._file = open(temporary, "w", encoding="ascii", newline="\n")
        self._file.write(json.dumps({"settings": settings}) + "\n")
        for place, done in kept:
            self.append(place, done)
        self._file.flush()
        os.replace(temporary, path)

    def _read(self, settings: str) -> Iterator[tuple[int, dict[str, Any]]]:
        with open(self._path, encoding="ascii") as file:
            lines = iter(file)
            try:
                if json.loads(next(lines, "")) != {"settings": settings}:
                    raise InputError(
                        f"{self._path} is the journal of another input or of other options, "
                        "expected the same ones: delete it, or pass resume=False"
                    )
                for line in lines:
                    # A line that a kill cut off has no line end, or is not JSON.
                    if line.endswith("\n"):
                        entry = json.loads(line)
                        yield entry["place"], entry["done"]
            except json.JSONDecodeError:
                return

    def append(self, place: int, done: dict[str, Any]) -> None:
        self.done[place] = done
        self._file.write(json.dumps({"place": place, "done": done}) + "\n")
        self._file.flush()

    def remove(self) -> None:
        self._file.close()
        self._path.unlink()


def _csv_of(parquet: Path, output: Path) -> Path:
    """Writes the rows of a Parquet file as a result file next to the output."""
    import pyarrow.parquet

    def numbers(value: Any) -> str:
        return value if isinstance(value, str) else " ".join(repr(float(x)) for x in value)

    table = pyarrow.parquet.read_table(parquet).to_pylist()
    path = Path(f"{output}.hypotheses.csv")
    bop.write_results(
        path,
        (
            f"{row['scene_id']},{row['im_id']},{row['obj_id']},{row['score']!r},"
            f"{numbers(row['R'])},{numbers(row['t'])},{row.get('time', -1)!r}"
            for row in table
        ),
    )
    return path
