"""Compares the bytes of `hybrid_icp.ray` and `hybrid_icp.bop` with those of `bop refine`."""

import json
import os
import shutil
import signal
import subprocess
import sys

import pytest

import hybrid_icp as hi
from hybrid_icp import bop
from ray_processes import can_start, start, workers


@pytest.fixture(scope="module")
def ray():
    try:
        import ray
    except (ImportError, OSError) as error:
        pytest.skip(f"no Ray: {error}; cargo xtask python --ray installs it")
    if not can_start(seconds=180):
        pytest.skip("Ray does not start on this machine")
    start(cpus=2)
    yield ray
    ray.shutdown()


def test_the_package_does_not_import_ray():
    code = "import sys, hybrid_icp.bop; print({'ray', 'pyarrow'} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert run.stdout.strip() == "set()"


def test_images_one_by_one_have_the_bytes_of_the_program(dataset, tmp_path):
    folder, results, expected = dataset
    images = bop.read_images(results)
    refiner = bop.DatasetRefiner(folder, "test", hi.Pipeline(), bop.object_ids(images))
    assert refiner.missing_models == [] and refiner.broken_models == {}
    lines = {}
    for _, _, indices, rows in reversed(images):
        refined, statuses, faults = refiner.refine(rows)
        assert len(statuses) == len(indices) and not faults
        lines.update(zip(indices, refined))
    bop.write_results(tmp_path / "out.csv", (lines[i] for i in sorted(lines)))
    assert (tmp_path / "out.csv").read_bytes() == expected
    with pytest.raises(hi.InputError, match="rows belong to 2 images, expected the rows of one"):
        refiner.refine(images[0][3] + images[1][3].removeprefix(bop.result_header()))


def test_the_options_of_a_dataset_are_those_of_the_program(dataset, program, tmp_path):
    folder, results, _ = dataset
    # The meshes in another folder, and the files of scenes of a sensor.
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    shutil.copytree(copy / "models", copy / "models_color")
    for scene in (copy / "test").iterdir():
        for path in list(scene.iterdir()):
            path.rename(path.with_name(f"{path.stem}_cam1{path.suffix}"))
    images = bop.read_images(results)
    options = {"mask": "none", "models": "models_color", "color": False, "sensor": "cam1"}
    refiner = bop.DatasetRefiner(copy, "test", hi.Pipeline(), bop.object_ids(images), **options)
    lines = {}
    for _, _, indices, rows in images:
        refined, _, faults = refiner.refine(rows)
        assert not faults
        lines.update(zip(indices, refined))
    out = tmp_path / "out.csv"
    words = ["bop", "refine", "--dataset", copy, "--results", results, "--output", out, "--no-time"]
    words += ["--mask", "none", "--models", "models_color", "--no-color", "--sensor", "cam1"]
    subprocess.run([program, *words], check=True, capture_output=True)
    assert out.read_text().splitlines()[1:] == [lines[i] for i in sorted(lines)]
    with pytest.raises(hi.InputError, match='mask is "box", expected "visible" or "none"'):
        bop.DatasetRefiner(folder, "test", hi.Pipeline(), [1], mask="box")


def test_a_killed_worker_changes_no_byte(dataset, ray, tmp_path):
    import hybrid_icp.ray

    folder, results, expected = dataset
    killed, seen = [], []

    def kill_one(done, total):
        seen.append((done, total))
        alive = workers()
        if not killed and alive and done < total:
            os.kill(alive[0], signal.SIGKILL)
            killed.append(alive[0])

    # All tasks may be finished before the first call of `kill_one`.
    for _ in range(10):
        seen.clear()
        statuses = hybrid_icp.ray.refine(
            folder, results, tmp_path / "out.csv", rows_per_task=1, workers=2, progress=kill_one
        )
        assert (tmp_path / "out.csv").read_bytes() == expected
        if killed:
            break
    assert killed, "found no worker to kill"
    assert (tmp_path / "out.csv").read_bytes() == expected
    assert sum(statuses.values()) == expected.count(b"\n") - 1 == seen[-1][0] == seen[-1][1]
    assert not (tmp_path / "out.csv.journal").exists()


def test_a_run_continues_from_the_journal_of_a_killed_driver(dataset, ray, tmp_path):
    import hybrid_icp.ray

    folder, results, expected = dataset

    class Killed(Exception):
        pass

    def fail(done, total):
        raise Killed

    def run(progress=None, **options):
        options |= {"rows_per_task": 1, "progress": progress}
        return hybrid_icp.ray.refine(folder, results, tmp_path / "out.csv", **options)

    with pytest.raises(Killed):
        run(fail)
    journal = tmp_path / "out.csv.journal"
    before = journal.read_text()
    assert before.count("\n") >= 2
    # The last line is cut off, and its task runs again.
    journal.write_text(before + '{"place": 1, "done": {"li')
    with pytest.raises(hi.InputError, match="journal of another input"):
        run(rescore="mve")
    done = []
    run(lambda now, total: done.append((now, total)))
    assert (tmp_path / "out.csv").read_bytes() == expected
    assert len(done) < len(bop.read_images(results))


def test_every_parameter_of_ray_is_documented(ray):
    import inspect

    import hybrid_icp.ray

    text = inspect.getdoc(hybrid_icp.ray.refine)
    for parameter in inspect.signature(hybrid_icp.ray.refine).parameters:
        assert f"\n{parameter} : " in text, parameter


def test_hypotheses_can_be_a_parquet_file(dataset, ray, tmp_path):
    import csv

    import pyarrow
    import pyarrow.parquet

    import hybrid_icp.ray

    folder, results, expected = dataset
    with open(results, newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row.update({key: int(row[key]) for key in ("scene_id", "im_id", "obj_id")})
        row.update({key: [float(x) for x in row[key].split()] for key in ("R", "t")})
        row.update({key: float(row[key]) for key in ("score", "time")})
    table = pyarrow.Table.from_pylist(rows)
    pyarrow.parquet.write_table(table, tmp_path / "hypotheses.parquet")
    hybrid_icp.ray.refine(folder, tmp_path / "hypotheses.parquet", tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_bytes() == expected
