"""The fixtures: the scene of the examples with a smaller image, and the datasets."""

import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

import hybrid_icp as hi

ROOT = Path(__file__).resolve().parents[3]
# The reference implementation of the BOP errors.
sys.path.insert(0, str(ROOT / "tests" / "agreement"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))

from scene import bracket, pose  # noqa: E402, F401
from scene import scene as generated  # noqa: E402


@pytest.fixture(scope="session")
def scene():
    return generated(hi.Camera(300, 305, 159.5, 121, 320, 240))


def many(scene, count):
    """Returns reproducible initial poses around the true pose."""
    random = np.random.default_rng(7)
    motions = [pose(random.normal(0, 0.06, 3), random.normal(0, 0.006, 3)) for _ in range(count)]
    return np.array([motion @ scene.true for motion in motions])


def write_png(path, pixels):
    """Writes a gray PNG with 8 or 16 bits."""
    height, width = pixels.shape
    raw = b"".join(b"\0" + row.astype(pixels.dtype.newbyteorder(">")).tobytes() for row in pixels)

    def chunk(tag, data):
        return struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))

    header = struct.pack(">IIBBBBB", width, height, 8 * pixels.dtype.itemsize, 0, 0, 0, 0)
    chunks = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunks)


@pytest.fixture(scope="session")
def ycbv():
    """Returns the folder of the YCB-Video excerpt with result files, or skips the test."""
    data = os.environ.get("HICP_DATA")
    named = [os.environ.get("BOP_PATH"), data and data + "/bop"]
    shared = ROOT.parent / "shared" / "data" / "bop"
    for folder in [Path(name) for name in named if name] + [shared]:
        if (folder / "ycbv" / "results").is_dir():
            return folder / "ycbv"
    pytest.skip("no ycbv dataset; set BOP_PATH to the folder that contains it")


@pytest.fixture(scope="session")
def program():
    """Returns the path of the program hybrid-icp."""
    path = os.environ.get("HYBRID_ICP_PROGRAM")
    if not path:
        pytest.skip("HYBRID_ICP_PROGRAM is not set; run cargo xtask python")
    return path


@pytest.fixture(scope="session")
def dataset(program, tmp_path_factory):
    """Generates a dataset with hypotheses, and the output of `bop refine` for them."""
    folder = tmp_path_factory.mktemp("bop")
    synthetic, expected = folder / "synthetic", folder / "expected.csv"
    results = synthetic / "initial_synthetic-test.csv"
    generate = ["generate", "--scenes", "2", "--out", synthetic]
    refine = ["refine", "--dataset", synthetic, "--results", results, "--output", expected]
    for command in (generate, [*refine, "--no-time"]):
        subprocess.run([program, "bop", *command], check=True, capture_output=True)
    return synthetic, results, expected.read_bytes()
