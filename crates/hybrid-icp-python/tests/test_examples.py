"""Runs the examples, and the Python blocks of the READMEs and the book."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[1] / "examples"


def run(name, *arguments):
    command = [sys.executable, FOLDER / name, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_one_frame_is_refined():
    printed = run("01_refine_one_frame.py").splitlines()[-1]
    before, after = (float(word) for word in printed.split() if word[0].isdigit())
    assert before > 10 and after < 0.1


def test_a_custom_loop_improves_a_dataset(dataset, tmp_path):
    folder, results, expected = dataset
    words = run("02_bop_loop.py", folder, results, tmp_path / "refined.csv").split()
    improved, count = int(words[0]), int(words[2])
    with open(tmp_path / "refined.csv", newline="") as file:
        refined = list(csv.DictReader(file))
    assert len(refined) == count
    assert improved > count / 2
    # The program chooses the same instances.
    by_program = csv.DictReader(expected.decode().splitlines())
    of_loop, of_program = (
        np.array([row["t"].split() for row in rows], float) for rows in (refined, by_program)
    )
    assert np.mean(np.linalg.norm(of_loop - of_program, axis=1) < 10) > 0.9


def test_meshes_of_other_libraries_are_accepted():
    printed = run("03_after_a_detector.py")
    # Open3D may be installed without a system library that it requires.
    skipped = [line for line in printed.splitlines() if line.startswith("skipped: ")]
    assert printed.count(": Model(12 vertices, 20 faces") + len(skipped) == 2
    assert "trimesh: Model" in printed


@pytest.mark.parametrize("readme", [FOLDER.parent / "README.md", FOLDER.parents[2] / "README.md"])
def test_the_examples_of_the_readmes_improve_a_pose(readme):
    assert "Result(refined" in run("smoke.py", readme)


PAGES = [
    "book/first-refinement.md", "book/sequences.md", "coming-from.md", "from-what-you-have.md",
    "python.md",
]


@pytest.mark.parametrize("page", PAGES)
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
    cloud = "\n".join(rows[: len(vertices)])
    for name in ["a.ply", "b.pcd"]:  # Text, recognized by its content.
        (tmp_path / name).write_text(cloud)
    monkeypatch.chdir(tmp_path)
    names = {
        "depth_m": frame.depth, "mask": frame.mask, "masks": [frame.mask], "K": frame.camera.K,
        "T_co": frame.rough, "T_co_N44": np.stack([frame.rough] * 2), "model": frame.model,
        "grasp": lambda pose: None, "T_ts": np.eye(4),
        "frames": [(frame.observation, np.eye(4))] * 2, "T_bc": np.eye(4),
        "cameras": [(frame.observation, np.eye(4))] * 2,
        "source_points": vertices / 1000, "target_points": vertices / 1000 + 0.001,
    }
    blocks = (FOLDER.parents[2] / "docs" / page).read_text().split("```python\n")[1:]
    assert blocks
    for block in blocks:
        exec(compile(block.split("```")[0], page, "exec"), names)


@pytest.mark.parametrize("notebook", sorted((FOLDER / "notebooks").glob("*.ipynb")), ids=str)
def test_the_code_of_the_notebooks_runs_and_their_pictures_are_stored(notebook):
    pytest.importorskip("matplotlib")
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert any("image/png" in out.get("data", {}) for cell in code for out in cell["outputs"])
    text = "\n".join("".join(cell["source"]) for cell in code)
    command = [sys.executable, "-c", text]
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    subprocess.run(command, check=True, cwd=notebook.parent, env=environment, timeout=300)
