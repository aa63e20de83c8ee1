"""Compares the bits of the module with the JSON output of `hybrid-icp refine`."""

import json
import subprocess

import numpy as np
import pytest

import hybrid_icp as hi
from conftest import bracket, many, write_png


def compare(program, folder, pipeline, model, depth, scale_mm, mask, camera, rotation, translation_mm):
    """Refines with the program and with the module, and compares every number of the report."""
    folder.mkdir(exist_ok=True)
    (folder / "camera.json").write_text(json.dumps({"cam_K": camera.K.flatten().tolist()}))
    pose = {"cam_R_m2c": rotation, "cam_t_m2c": translation_mm}
    (folder / "pose.json").write_text(json.dumps(pose))
    subprocess.run(
        [
            program, "refine", "--pipeline", pipeline, "--model", model, "--model-unit", "mm",
            "--depth", depth, "--depth-scale", repr(scale_mm), "--mask", mask,
            "--camera", folder / "camera.json", "--init", folder / "pose.json",
            "--output", folder / "refined.json",
        ],
        check=True, capture_output=True,
    )
    stated = json.loads((folder / "refined.json").read_text())

    init = np.eye(4)
    init[:3, :3] = np.reshape(rotation, (3, 3))
    init[:3, 3] = np.array(translation_mm) / 1000.0
    image, object_mask = hi.read_depth_png(depth, scale_mm / 1000), hi.read_mask_png(mask)
    observation = hi.Observation(image, object_mask, camera)
    mesh = hi.Model.from_file(model, unit="mm")
    result = hi.Pipeline.preset(pipeline).refine(mesh, observation, init)
    found = result.to_dict()
    assert stated["cam_R_m2c"] == result.T_co[:3, :3].flatten().tolist()
    if result.refined:
        assert stated["cam_t_m2c"] == (result.T_co[:3, 3] * 1000.0).tolist()
    keys = ("confidence", "mve", "mve_initial", "evidence", "outcome", "termination")
    for key in (*keys, "iterations", "n_pairs"):
        assert stated[key] == found[key], key
    for theirs, ours in zip(stated["trace"], found["stages"], strict=True):
        theirs.pop("stage")
        assert theirs == {key: ours[key] for key in theirs}
    return result


@pytest.mark.parametrize("pipeline", ["hybrid", "nn-point-to-plane"])
def test_a_generated_frame_has_the_bits_of_the_program(program, tmp_path, scene, pipeline):
    vertices, faces = bracket()
    lines = [f"v {x} {y} {z}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    (tmp_path / "model.obj").write_text("\n".join(lines))
    write_png(tmp_path / "depth.png", np.round(scene.depth * 10000).astype(np.uint16))
    write_png(tmp_path / "mask.png", scene.mask.astype(np.uint8) * 255)
    files = [tmp_path / name for name in ("model.obj", "depth.png")]
    for rough in many(scene, 3):
        result = compare(
            program, tmp_path / "case", pipeline, files[0], files[1], 0.1, tmp_path / "mask.png",
            scene.camera, rough[:3, :3].flatten().tolist(), (rough[:3, 3] * 1000).tolist(),
        )
        assert result.refined


def test_the_ycbv_frames_have_the_bits_of_the_program(program, tmp_path, ycbv):
    count = 0
    for folder in sorted((ycbv / "test").iterdir()):
        cameras, truths, estimates = (
            json.loads((folder / f"{name}.json").read_text())
            for name in ("scene_camera", "scene_gt", "scene_init")
        )
        for image, instances in truths.items():
            name = f"{int(image):06}"
            K = np.reshape(cameras[image]["cam_K"], (3, 3))
            for instance, truth in enumerate(instances):
                rough = estimates[image][instance]["cosypose"]
                mask = folder / "mask_visib" / f"{name}_{instance:06}.png"
                camera = hi.Camera.from_K(K, hi.read_mask_png(mask).shape[::-1])
                model = ycbv / "models" / f"obj_{truth['obj_id']:06}.ply"
                compare(
                    program, tmp_path / "case", "hybrid", model, folder / "depth" / f"{name}.png",
                    cameras[image]["depth_scale"], mask, camera, rough["cam_R_m2c"],
                    rough["cam_t_m2c"],
                )
                count += 1
    assert count == 19
