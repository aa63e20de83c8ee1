"""The examples run as they are, and do what they say."""

import csv
import subprocess
import sys
from pathlib import Path

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
