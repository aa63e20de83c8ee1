"""Refines every row of a BOP result file in a custom loop, and keeps the poses with a lower MVE.

    python 02_bop_loop.py DATASET RESULTS.csv REFINED.csv

Two pipelines refine every instance, and the result with the lower MVE counts. For one pipeline,
`hybrid-icp bop refine` is faster.
"""

from __future__ import annotations

import csv
import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

from hybrid_icp import Camera, DepthImage, Model, Observation, Pipeline, read_mask_png


def main(dataset: Path, results: Path, refined: Path) -> None:
    with open(results, newline="") as file:
        rows = list(csv.DictReader(file))
    images = defaultdict(list)
    for row in rows:
        images[int(row["scene_id"]), int(row["im_id"])].append(row)
    models: dict[int, Model] = {}
    pipelines = [Pipeline(), Pipeline("hybrid")]

    improved = 0
    for (scene, image), of_image in sorted(images.items()):
        folder = dataset / "test" / f"{scene:06}"
        calibration, truths = (
            json.loads((folder / f"{name}.json").read_text())[str(image)]
            for name in ("scene_camera", "scene_gt")
        )
        # Read the image once, for all of its masks.
        scale = calibration["depth_scale"] / 1000
        depth = DepthImage.from_png(folder / "depth" / f"{image:06}.png", scale)
        K = np.reshape(calibration["cam_K"], (3, 3))
        camera = Camera.from_K(K, (depth.width, depth.height))
        # The masks of the instances replace those of a detector.
        instances = defaultdict(list)
        for index, truth in enumerate(truths):
            mask = read_mask_png(folder / "mask_visib" / f"{image:06}_{index:06}.png")
            if mask.any():
                instances[truth["obj_id"]].append(Observation(depth, mask, camera))
        for row in of_image:
            object_id = int(row["obj_id"])
            if object_id not in models:
                models[object_id] = Model.from_bop(dataset / "models", object_id)
            model = models[object_id]
            rough = np.eye(4)
            rough[:3, :3] = np.reshape(row["R"].split(), (3, 3)).astype(float)
            rough[:3, 3] = np.array(row["t"].split(), float) / 1000
            if object_id not in instances:
                continue
            # Of several instances, the pose belongs to the one that it explains best.
            explained = [pipelines[0].judge(model, o, rough).mve for o in instances[object_id]]
            observation = instances[object_id][int(np.argmin(explained))]
            refined_by = (p.refine(model, observation, rough) for p in pipelines)
            best = min(refined_by, key=lambda result: result.mve)
            if best.mve < best.mve_initial:
                improved += 1
                row["R"] = " ".join(map(repr, best.T_co[:3, :3].flatten().tolist()))
                row["t"] = " ".join(map(repr, (best.T_co[:3, 3] * 1000).tolist()))
            row["score"] = repr(1 - min(best.mve, best.mve_initial))

    with open(refined, "w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"{improved} of {len(rows)} poses have a lower MVE than before")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        raise SystemExit(__doc__)
    main(*map(Path, sys.argv[1:]))
