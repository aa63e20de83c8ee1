"""The diagnosis of inputs."""

import json

import numpy as np
import pytest

import hybrid_icp as hi


def test_inputs_that_fit_have_no_fault(scene):
    diagnosis = hi.diagnose(scene.model, scene.observation, scene.rough)
    assert diagnosis.faults == [] and diagnosis.score < 0.2
    text = "the model at the pose explains the image"
    assert str(diagnosis) == f"no fault found (score {diagnosis.score:.3f}): {text}"


def test_a_fault_is_named_with_its_fix_and_numbers(scene):
    """The unit of the pose is beyond what `refine` accepts."""
    millimeters = scene.rough.copy()
    millimeters[:3, 3] *= 1000
    with pytest.raises(hi.InputError, match="millimeters"):
        hi.Pipeline().refine(scene.model, scene.observation, millimeters)
    diagnosis = hi.diagnose(scene.model, scene.observation, millimeters)
    first = diagnosis.faults[0]
    assert first.fault == "translation_scale" and first.numbers == {"factor": 0.001}
    assert first.fix == "multiply the translation of the pose by 0.001"
    assert first.score < 0.2 < diagnosis.score
    assert str(diagnosis).splitlines()[1] == f"  fix: {first.fix}"
    assert json.loads(json.dumps(diagnosis.to_dict()))["faults"][0] == first.to_dict()
    assert repr(first) == "Fault(translation_scale, {'factor': 0.001})"
    assert repr(diagnosis).startswith("Diagnosis(['translation_scale'")


def test_intrinsics_in_the_order_of_a_flat_matrix_are_named(scene):
    camera = scene.camera
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    flat = hi.Camera(fx, cx, fy, cy, camera.width, camera.height)
    seen = hi.Observation(scene.depth, scene.mask, flat)
    first = hi.diagnose(scene.model, seen, scene.rough).faults[0]
    assert first.fault == "intrinsics"
    assert first.numbers == pytest.approx({"fx": fx, "fy": fy, "cx": cx, "cy": cy})


def test_a_fact_has_no_score(scene):
    empty = hi.Observation(scene.observation.image, np.zeros((240, 320), bool), scene.camera)
    diagnosis = hi.diagnose(scene.model, empty, scene.rough)
    assert [(fault.fault, fault.score) for fault in diagnosis.faults] == [("mask_empty", None)]
