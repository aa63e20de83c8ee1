"""One generated scene for all tests, that of the examples, smaller."""

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
# The implementation of BOP's errors that is written from their definitions.
sys.path.insert(0, str(ROOT / "tests" / "agreement"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))

from scene import bracket, pose  # noqa: E402, F401
from scene import scene as generated  # noqa: E402


@pytest.fixture(scope="session")
def scene():
    return generated(hi.Camera(300, 305, 159.5, 121, 320, 240))


def many(scene, count):
    """Rough poses about the true one, the same every time."""
    random = np.random.default_rng(7)
    motions = [pose(random.normal(0, 0.06, 3), random.normal(0, 0.006, 3)) for _ in range(count)]
    return np.array([motion @ scene.true for motion in motions])


def write_png(path, pixels):
    """Writes a grey PNG of 8 or 16 bits."""
    height, width = pixels.shape
    raw = b"".join(b"\0" + row.astype(pixels.dtype.newbyteorder(">")).tobytes() for row in pixels)

    def chunk(tag, data):
        return struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))

    header = struct.pack(">IIBBBBB", width, height, 8 * pixels.dtype.itemsize, 0, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


@pytest.fixture(scope="session")
def ycbv():
    """The folder of the YCB-Video frames that these tests are of, an excerpt with result files, or a skip that says so."""
    named = [os.environ.get("BOP_PATH"), os.environ.get("HICP_DATA") and os.environ["HICP_DATA"] + "/bop"]
    for folder in [Path(name) for name in named if name] + [ROOT.parent / "shared" / "data" / "bop"]:
        if (folder / "ycbv" / "results").is_dir():
            return folder / "ycbv"
    pytest.skip("no ycbv dataset; set BOP_PATH to the folder that holds it")


@pytest.fixture(scope="session")
def program():
    """The program hybrid-icp."""
    path = os.environ.get("HYBRID_ICP_PROGRAM")
    if not path:
        pytest.skip("HYBRID_ICP_PROGRAM does not name the program hybrid-icp; cargo xtask python sets it")
    return path


@pytest.fixture(scope="session")
def dataset(program, tmp_path_factory):
    """A generated dataset, its hypotheses, and what `bop refine` makes of them."""
    folder = tmp_path_factory.mktemp("bop")
    subprocess.run([program, "bop", "generate", "--scenes", "2", "--out", folder / "synthetic"], check=True, capture_output=True)
    results, expected = folder / "synthetic" / "initial_synthetic-test.csv", folder / "expected.csv"
    subprocess.run(
        [program, "bop", "refine", "--dataset", folder / "synthetic", "--results", results, "--output", expected, "--no-time"],
        check=True, capture_output=True,
    )
    return folder / "synthetic", results, expected.read_bytes()
