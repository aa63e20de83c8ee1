"""Tests the program inside of the wheel."""

import re
import subprocess
import sys
from importlib.metadata import files, metadata

import hybrid_icp as hi


def run(*words, folder):
    command = [sys.executable, "-m", "hybrid_icp", *words]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder)


def test_the_program_runs_with_its_exit_codes(tmp_path):
    demo = run("demo", folder=tmp_path)
    assert demo.returncode == 0 and "refined" in demo.stdout.lower(), demo.stderr
    assert run("--version", folder=tmp_path).stdout.split()[1] == hi.__version__
    wrong = run("refin", folder=tmp_path)
    assert wrong.returncode == 2 and "refine" in wrong.stderr
    missing = run("inspect", "missing.ply", "--unit", "mm", folder=tmp_path)
    assert missing.returncode == 1 and "missing.ply" in missing.stderr


def test_the_wheel_has_its_licenses_and_its_program():
    names = [str(path) for path in files("hybrid-icp")]
    assert any(name.endswith("licenses/LICENSE-MIT") for name in names)
    assert any(name.endswith("licenses/LICENSE-APACHE") for name in names)
    assert any(re.search(r"bin/hybrid-icp(\.exe)?$", name) for name in names)
    assert metadata("hybrid-icp")["License-Expression"] == "MIT OR Apache-2.0"
