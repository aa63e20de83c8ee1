"""Tests fusion and the sequential estimator."""

import numpy as np
import pytest

import hybrid_icp as hi
from conftest import pose


def at(x, variance, **options):
    return hi.PoseEstimate(pose([0, 0, 0], [x, 0, 0.5]), np.eye(6) * variance, **options)


def test_estimates_are_weighted_by_their_information():
    fused = hi.fuse([at(0, 1e-6), at(0.004, 3e-6)])
    assert np.isclose(fused.T_co[0, 3], 0.001, atol=1e-9)
    assert np.isclose(fused.covariance[0, 0], 0.75e-6, rtol=1e-6)
    assert np.isclose(at(0, 1e-6).mahalanobis_squared(at(0.004, 3e-6)), 4.0)


def test_the_estimate_of_a_result_is_wider_than_its_covariance(scene):
    pipeline = hi.Pipeline.preset("hybrid")
    result = pipeline.refine(scene.model, scene.observation, scene.rough)
    estimate = hi.PoseEstimate.from_result(result, scene.model)
    assert np.allclose(estimate.T_co, result.T_co) and estimate.mve == result.mve
    added = np.linalg.eigvalsh(estimate.covariance - result.covariance)
    assert added.min() > 0
    assert np.sqrt(added[-3:]).max() < 0.01  # a hundredth of 1 rad and of the radius


@pytest.mark.parametrize("method", hi.Fuser.methods())
def test_every_method_follows_the_camera(method):
    fuser = hi.Fuser(method)
    assert fuser.estimate is None
    assert fuser.update(at(0, 1e-6)) == "accepted"
    fuser.propagate(pose([0, 0, 0], [0, 0, -0.1]))
    assert np.isclose(fuser.estimate.T_co[2, 3], 0.4)
    fuser.reset()
    assert fuser.estimate is None


def test_a_gate_rejects_estimates_that_are_far_or_have_a_high_mve(scene):
    gate = {"max_mve": 0.4, "max_mahalanobis_squared": 20, "restart_after": 2}
    fuser = hi.Fuser("average", model=scene.model, **gate)
    assert fuser.update(at(0, 1e-6, mve=0.1)) == "accepted"
    assert fuser.update(at(0, 1e-6, mve=0.9)) == "rejected"
    assert fuser.update(at(0.3, 1e-6, mve=0.1)) == "rejected"
    assert fuser.update(at(0.3, 1e-6, mve=0.1)) == "restarted"


@pytest.mark.parametrize("paper", [False, True])
def test_the_sequential_estimator_follows_a_moving_camera(scene, paper):
    pipeline = hi.Pipeline.preset("hybrid")
    estimator = hi.SequentialEstimator(
        pipeline, "weighted-average", scene.model, scene.rough, paper=paper
    )
    assert np.allclose(estimator.T_co, scene.rough) and estimator.estimate is None
    motion = pose([0.02, 0.01, 0.0], [0.005, 0.0, -0.01])
    true, step = scene.true, None
    for frame in range(3):
        if frame:
            true = motion @ true
        depth = hi.render_depth(scene.model, scene.camera, true)
        observation = hi.Observation(depth, depth > 0, scene.camera)
        step = estimator.step(observation, motion if frame else None)
    assert step.event == "accepted" and step.mve < 0.1
    assert hi.add(step.T_co, true, scene.model) < 0.002
    assert np.array_equal(step.T_co, estimator.T_co) and step.covariance.shape == (6, 6)
    nothing = hi.Observation(np.zeros((240, 320), np.float32), None, scene.camera)
    # The paper fuses the initial pose if ICP finds no pairs.
    assert estimator.step(nothing).event == ("accepted" if paper else "no_estimate")
    estimator.restart(scene.rough)
    assert estimator.estimate is None


def test_the_sequential_estimator_warns_of_the_first_pose_and_states_its_place(scene):
    inverted = np.linalg.inv(scene.true)
    estimator = hi.SequentialEstimator(hi.Pipeline("local"), "average", scene.model, inverted)
    with pytest.warns(hi.InputWarning, match="behind the camera, .* not object from camera"):
        estimator.step(scene.observation)
    estimator.restart(scene.true)
    text = "SequentialEstimator('average', no estimate, t = (0.0200, -0.0100, 0.4200) m)"
    assert repr(estimator) == text
    estimator.step(scene.observation)
    assert repr(estimator).startswith("SequentialEstimator('average', estimated, t = (0.0")


def test_the_sequential_estimator_warns_of_a_wrong_motion(scene):
    arguments = hi.Pipeline("hybrid"), "weighted-average", scene.model, scene.rough
    estimator = hi.SequentialEstimator(*arguments)
    motion = pose([0.0, 0.0, 0.0], [0.0, 0.0, 0.02])
    true, steps = scene.true, []
    with pytest.warns(hi.InputWarning, match="check that T_nc is the next camera from"):
        for _ in range(4):
            depth = hi.render_depth(scene.model, scene.camera, true)
            observation = hi.Observation(depth, depth > 0, scene.camera)
            steps.append(estimator.step(observation, np.linalg.inv(motion) if steps else None))
            true = motion @ true
    assert [step.event for step in steps] == ["accepted", "rejected", "rejected", "rejected"]
    assert steps[0].reason is None and "Mahalanobis" in steps[1].reason


def test_the_sequential_estimator_warns_of_images_that_show_the_object_elsewhere(scene):
    """The object is so far off that nothing is paired, and the fuser never starts again."""

    def events(depths):
        arguments = hi.Pipeline("hybrid"), "weighted-average", scene.model, scene.rough
        estimator = hi.SequentialEstimator(*arguments)
        for depth in depths:
            step = estimator.step(hi.Observation(depth, depth > 0, scene.camera))
            yield step.event, step.reason

    def rendered(z):
        true = pose([0, 0, 0], [0, 0, z]) @ scene.true
        return hi.render_depth(scene.model, scene.camera, true)

    there, elsewhere = rendered(0.0), rendered(2.0)
    with pytest.warns(hi.InputWarning, match="as were accepted, or more, contradict .* T_nc") as w:
        found = list(events([there, elsewhere, elsewhere, elsewhere]))
    assert len(w) == 1
    assert found[0] == ("accepted", None)
    assert all(event == "no_estimate" and reason for event, reason in found[1:])
    # An image without the object contradicts nothing.
    nothing = np.zeros_like(there)
    assert [event for event, _ in events([there, nothing, nothing])][1:] == ["no_estimate"] * 2


def test_a_calibrated_covariance_is_at_least_the_error_of_models(scene):
    def deviation(**options):
        arguments = hi.Pipeline("hybrid"), "weighted-average", scene.model, scene.rough
        step = hi.SequentialEstimator(*arguments, **options).step(scene.observation)
        x, y, z = step.T_co[:3, :3] @ scene.model.center + step.T_co[:3, 3]
        of_center = np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]])
        variance = np.trace(of_center @ step.covariance @ of_center.T) / 3
        return np.sqrt(variance) / scene.model.radius

    assert 0.02 < deviation() < 0.03 < deviation(covariance="mve")
    for options, message in [
        ({"covariance": "exact"}, 'covariance is "exact", expected "mve" or "calibrated"'),
        ({"covariance": "calibrated", "paper": True}, "paper is True with covariance="),
    ]:
        with pytest.raises(hi.InputError, match=message):
            deviation(**options)
