"""Runs the Python example of a README on a generated frame.

    python smoke.py README.md

Fails if the ADI of the refined pose is above 1 mm.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from scene import bracket, scene

from hybrid_icp import adi


def main(readme: Path) -> None:
    text = readme.read_text()
    code = text.split("```python\n", 1)[1].split("```", 1)[0]
    frame = scene()
    vertices, faces = bracket()
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "mug.obj"
        lines = [f"v {x} {y} {z}" for x, y, z in vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
        mesh.write_text("\n".join(lines))
        grasped: list[Any] = []
        names: dict[str, Any] = {
            "depth_m": frame.depth, "mask": frame.mask, "K": frame.camera.K, "T_co": frame.rough,
            "grasp": grasped.append,
        }
        exec(compile(code.replace("mug.ply", mesh.as_posix()), str(readme), "exec"), names)
    result = names["result"]
    before, after = (adi(pose, frame.true, frame.model) for pose in (frame.rough, result.T_co))
    print(f"{readme}: {result}, ADI {before * 1000:.2f} mm -> {after * 1000:.2f} mm")
    if len(grasped) != 1 or after > 0.001:
        raise SystemExit(f"{readme}: the ADI is {after * 1000:.2f} mm, expected at most 1 mm")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
