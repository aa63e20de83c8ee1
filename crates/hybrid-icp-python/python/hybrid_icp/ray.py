"""Refine a BOP result file on Ray: on the cores of a laptop or on a cluster, with the bytes of `hybrid-icp bop refine --no-time`.

Wants the extra: ``pip install 'hybrid_icp[ray]'``. Nothing of Ray is imported by `hybrid_icp` itself.

Rows are grouped by image, so that an image is decoded and an observation built once, whatever the number of hypotheses. Actors read the
models once. Each task is a few images; its result goes to a journal beside the output, which one process writes: the driver. A worker that dies
is started again and its task repeated; a driver that dies goes on from the journal.
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
    """An actor: a dataset's models in memory, one image after the other."""

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
    rescore: str = "keep",
    workers: int | None = None,
    num_cpus: float = 0.5,
    rows_per_task: int = 256,
    limit: int | None = None,
    resume: bool = True,
    progress: Callable[[int, int], object] | None = None,
) -> dict[str, int]:
    """Refines every row of a result file on Ray.

    `ray.init` (or the cluster's address) comes first; without it Ray starts on this machine.

    Parameters
    ----------
    dataset : str or os.PathLike
        The dataset's folder; every worker reads it there.
    results : str or os.PathLike
        The result file: CSV, or Parquet with the same columns (R and t as lists or as texts of numbers, t in mm).
    output : str or os.PathLike
        Where the refined result file goes, with the rows in their order; beside it a journal while it runs.
    split : str, optional
        The split's folder.
    pipeline : Pipeline, optional
        `auto` if not given, as in the program.
    detections : str or os.PathLike, optional
        Take the masks from a detections file instead of mask_visib.
    rescore : {"keep", "mve"}, optional
        What becomes the score: the row's own, or 1 - MVE.
    workers : int, optional
        Number of actors, each of one thread; the number of the cluster's CPUs if not given.
    num_cpus : float, optional
        CPUs that an actor reserves. Less than 1, so that actors on every CPU leave room for the tasks that feed them: with 1
        they would wait for each other for ever.
    rows_per_task : int, optional
        Rows after which a task is full; images are never split. What is lost when a worker dies.
    limit : int, optional
        Refine only the first rows.
    resume : bool, optional
        Go on from the journal of a run of the same input that was killed.
    progress : callable, optional
        Told the number of rows that are done and of all, after every task.

    Returns
    -------
    dict of str to int
        Number of rows by what became of them.

    Raises
    ------
    InputError
        When a file of the dataset is damaged; the output is written all the same, with the rows that need it unchanged.
    """
    pipeline = pipeline or Pipeline.preset("auto")
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
        items = [{"place": place, "task": json.dumps([image[3] for image in tasks[place]])} for place in missing]
        work = ray.data.from_items(items, override_num_blocks=min(len(items), 16 * workers)).map_batches(
            _Worker,
            fn_constructor_args=[arguments],
            batch_size=1,
            compute=ray.data.ActorPoolStrategy(size=min(workers, len(items))),
            # Ray Data's own defaults restart a dead actor and repeat its tasks without limit.
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
        raise InputError(f"{len(faults)} files could not be used, and their rows are in {output} unchanged; the first: {faults[0]}")
    return statuses


def _tasks(images: list[_Image], rows_per_task: int) -> Iterator[list[_Image]]:
    """Images in order, some to a task."""
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
    """What the results depend on: a run goes on only with the work of one that has the same."""
    digest = hashlib.sha256()
    digest.update(repr([str(value) for value in arguments.values()]).encode())
    digest.update(repr(pipeline.__reduce__()[1]).encode())
    for task in tasks:
        for image in task:
            digest.update(repr(image).encode())
    return digest.hexdigest()


class _Journal:
    """The tasks that are done, one JSON object per line after a line that says what they belong to."""

    def __init__(self, path: Path, settings: str, resume: bool) -> None:
        self.done: dict[int, dict[str, Any]] = {}
        self._path = path
        kept = list(self._read(settings)) if resume and path.is_file() else []
        # What is kept replaces the journal whole, so that a kill now loses nothing.
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
                        f"{self._path} is the journal of another input or of other options: delete it, or pass resume=False"
                    )
                for line in lines:
                    # A line that was cut off by a kill does not end, or is no JSON.
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
    """Writes the rows of a Parquet file as a result file beside the output."""
    import pyarrow.parquet

    def numbers(value: Any) -> str:
        return value if isinstance(value, str) else " ".join(repr(float(x)) for x in value)

    table = pyarrow.parquet.read_table(parquet).to_pylist()
    path = Path(f"{output}.hypotheses.csv")
    bop.write_results(
        path,
        (
            f"{row['scene_id']},{row['im_id']},{row['obj_id']},{row['score']!r},{numbers(row['R'])},{numbers(row['t'])},{row.get('time', -1)!r}"
            for row in table
        ),
    )
    return path
