"""Refines one pose in one depth image.

    python 01_refine_one_frame.py                          # a generated frame
    python 01_refine_one_frame.py --model mug.ply --unit mm --depth depth.png --scale 0.001 \\
        --mask mask.png --camera camera.json --pose pose.json

The JSON files have the format of BOP: camera.json is {"cam_K": [nine numbers]}, and pose.json is
{"cam_R_m2c": [nine numbers], "cam_t_m2c": [three numbers, mm]}.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from scene import Array, scene

from hybrid_icp import Camera, Model, Observation, Pipeline, adi, read_depth_png, read_mask_png


def read(options: argparse.Namespace) -> tuple[Model, Observation, Array]:
    """Reads the model, the image and the initial pose."""
    depth = read_depth_png(options.depth, options.scale)
    height, width = depth.shape
    calibration = json.loads(options.camera.read_text())
    camera = Camera.from_K(np.reshape(calibration["cam_K"], (3, 3)), (width, height))
    pose = json.loads(options.pose.read_text())
    rough = np.eye(4)
    rough[:3, :3] = np.reshape(pose["cam_R_m2c"], (3, 3))
    rough[:3, 3] = np.array(pose["cam_t_m2c"]) / 1000
    model = Model.from_file(options.model, unit=options.unit)
    return model, Observation(depth, read_mask_png(options.mask), camera), rough


def main() -> None:
    parser = argparse.ArgumentParser()
    for name in ("model", "depth", "mask", "camera", "pose"):
        parser.add_argument(f"--{name}", type=Path)
    parser.add_argument("--unit", default="mm")
    parser.add_argument("--scale", type=float, default=0.001)
    options = parser.parse_args()

    pipeline = Pipeline()
    if options.model:
        model, observation, rough = read(options)
    else:
        frame = scene()
        model, observation, rough = frame.model, frame.observation, frame.rough
    result = pipeline.refine(model, observation, rough)
    print(result)
    for stage in result.stages:
        print(" ", stage)
    print(result.T_co)
    if not options.model:
        before, after = (adi(pose, frame.true, model) for pose in (rough, result.T_co))
        print(f"ADI {before * 1000:.2f} mm -> {after * 1000:.2f} mm")
        if after > 0.001:
            raise SystemExit(f"the ADI is {after * 1000:.2f} mm, expected at most 1 mm")


if __name__ == "__main__":
    main()
