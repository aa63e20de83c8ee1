"""The tracker of moving objects."""

import numpy as np
import pytest

import hybrid_icp as hi
from conftest import pose


def test_a_moving_object_is_tracked_lost_and_found(scene):
    tracker = hi.Tracker(scene.model, scene.camera, scene.rough)
    motion, true = pose([0.02, 0.01, 0.0], [0.004, 0.0, -0.003]), scene.true
    for frame in range(6):
        true = motion @ true if frame else true
        tracked = tracker.step(hi.render_depth(scene.model, scene.camera, true), 1 / 30)
    assert tracked.state == "tracking" and tracked.confidence > 0.9
    velocity = 30 * (true - np.linalg.inv(motion) @ true)[:3, 3]
    assert np.linalg.norm(tracked.velocity - velocity) < 0.3 * np.linalg.norm(velocity)
    assert np.allclose(tracked.angular_velocity, [0.6, 0.3, 0.0], atol=0.2)
    assert hi.add(tracked.T_co, true, scene.model) < 0.003
    assert tracked.evidence["agrees"] > 0.9 and 0 <= tracked.deviation < 0.01
    assert repr(tracked).startswith("Tracked(tracking, t = ")
    nothing = np.zeros((240, 320), np.float32)
    states = [tracker.step(nothing, 1 / 30).state for _ in range(6)]
    assert "tracking" not in states and states[-1] == "lost"
    patient = hi.Tracker(scene.model, scene.camera, true, coast_seconds=1.0)
    states = [patient.step(nothing, 1 / 30).state for _ in range(6)]
    assert states == 6 * ["doubtful"]
    tracker.restart(true)
    depth = hi.DepthImage(hi.render_depth(scene.model, scene.camera, true))
    assert tracker.step(depth, 1 / 30).state == "tracking"
    assert tracker.step(depth, 1 / 30, np.zeros((240, 320), bool)).state != "tracking"


def test_the_state_belongs_to_the_pose_even_if_the_time_is_wrong(scene):
    """Duplicate time stamps and wrong units make a filter lag behind the object."""
    motion = pose([0.02, 0.01, 0.0], [0.01, 0.0, -0.005])
    for seconds in (0, 1e-4):
        tracker, true = hi.Tracker(scene.model, scene.camera, scene.true), scene.true
        for _ in range(4):
            tracked = tracker.step(hi.render_depth(scene.model, scene.camera, true), seconds)
            assert tracked.state == "tracking"
            assert hi.mssd(tracked.T_co, true, scene.model) < 0.05 * scene.model.diameter
            true = motion @ true


def test_images_of_another_size_are_refused(scene):
    tracker = hi.Tracker(scene.model, scene.camera, scene.true)
    with pytest.raises(hi.InputError, match="4x3"):
        tracker.step(np.full((3, 4), 0.5, np.float32), 1 / 30)


def test_implausible_arguments_are_refused_or_cause_a_warning(scene):
    with pytest.raises(hi.InputError, match="meters_per_second is -1, expected a finite number"):
        hi.Tracker(scene.model, scene.camera, scene.true, meters_per_second=-1)
    with pytest.raises(hi.InputError, match="degrees_per_second is NaN, expected a finite number"):
        hi.Tracker(scene.model, scene.camera, scene.true, degrees_per_second=np.nan)
    with pytest.raises(hi.InputError, match="coast_seconds is -1, expected a finite number"):
        hi.Tracker(scene.model, scene.camera, scene.true, coast_seconds=-1)
    with pytest.warns(hi.InputWarning, match="behind the camera, .* not object from camera"):
        hi.Tracker(scene.model, scene.camera, np.linalg.inv(scene.true))
    tracker = hi.Tracker(scene.model, scene.camera, scene.true)
    for seconds in (-1 / 30, np.nan, np.inf, 33.0, None, scene.depth):
        with pytest.raises(hi.InputError, match=r"seconds is .*, expected the seconds since"):
            tracker.step(scene.depth, seconds)
    with pytest.raises(hi.InputError, match="seconds is an array"):
        tracker.step(1 / 30, scene.depth)
    assert repr(tracker) == "Tracker(started, t = (0.0200, -0.0100, 0.4200) m)"
    tracker.step(scene.depth, 0)
    assert repr(tracker).startswith("Tracker(tracking, t = (0.0")
