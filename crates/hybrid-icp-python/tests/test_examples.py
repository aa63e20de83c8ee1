"""The examples run as they are, and do what they say."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[1] / "examples"


def run(name, *arguments):
    return subprocess.run([sys.executable, FOLDER / name, *arguments], check=True, capture_output=True, text=True).stdout


def test_one_frame_is_refined():
    said = run("01_refine_one_frame.py").splitlines()[-1]
    before, after = (float(word) for word in said.split() if word[0].isdigit())
    assert before > 10 and after < 0.1


def test_a_loop_of_ones_own_improves_a_dataset(dataset, tmp_path):
    folder, results, _ = dataset
    said = run("02_bop_loop.py", folder, results, tmp_path / "refined.csv")
    improved, count = int(said.split()[0]), int(said.split()[2])
    with open(tmp_path / "refined.csv", newline="") as file:
        assert len(list(csv.DictReader(file))) == count
    assert improved > count / 2


def test_meshes_of_other_libraries_are_taken():
    said = run("03_after_a_detector.py")
    # Open3D may be there and miss a library of the system.
    left_out = [line for line in said.splitlines() if line.startswith("left out: ")]
    assert said.count(": Model(12 vertices, 20 faces") + len(left_out) == 2
    assert "trimesh: Model" in said


@pytest.mark.parametrize("readme", [FOLDER.parent / "README.md", FOLDER.parents[2] / "README.md"])
def test_the_examples_of_the_readmes_improve_a_pose(readme):
    assert "Result(refined" in run("smoke.py", readme)


@pytest.mark.parametrize("page", ["book/first-refinement.md", "coming-from.md", "python.md"])
def test_the_python_blocks_of_the_book_run(page, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    from scene import bracket, scene

    frame = scene()
    vertices, faces = bracket()
    head = f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [f"{x} {y} {z}" for x, y, z in vertices] + [f"3 {a} {b} {c}" for a, b, c in faces]
    (tmp_path / "mug.ply").write_text(head + "\n".join(rows) + "\n")
    monkeypatch.chdir(tmp_path)
    names = {
        "depth_m": frame.depth, "mask": frame.mask, "masks": [frame.mask], "K": frame.camera.K, "T_co": frame.rough,
        "T_co_N44": np.stack([frame.rough] * 2), "model": frame.model, "grasp": lambda pose: None,
    }
    blocks = (FOLDER.parents[2] / "docs" / page).read_text().split("```python\n")[1:]
    assert blocks
    for block in blocks:
        exec(compile(block.split("```")[0], page, "exec"), names)
