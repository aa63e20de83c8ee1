"""Registration of two point clouds."""

import contextlib
import signal
import time
from types import SimpleNamespace

import numpy as np
import pytest

import hybrid_icp as hi
from conftest import pose


def surface():
    """Returns 1,600 points, not on a grid, of a hilly surface of 0.2 m without symmetries."""
    x, y = np.random.default_rng(3).uniform(-0.1, 0.1, (2, 1600))
    return np.stack([x, y, 0.5 + 0.02 * np.sin(40 * x) * np.cos(30 * y + 5 * x)], axis=1)


@pytest.mark.parametrize("method", ["point-to-plane", "point-to-point", "gicp"])
def test_a_known_transform_is_recovered(method):
    motion = pose([0.01, -0.01, 0.005], [0.002, 0.002, -0.001])
    source = surface()
    target = source @ motion[:3, :3].T + motion[:3, 3]
    result = hi.align(source, target, method=method)
    assert np.abs(result.T_ts - motion).max() < 1e-4
    assert result.outcome == "refined" and result.fitness > 0.99 and result.rmse < 1e-4
    assert result.covariance.shape == (6, 6) and "estimated from 20" in result.warnings[0]
    moved = hi.align(source + 5.0, target, pose([0, 0, 0], [-5.0, -5.0, -5.0]), method=method)
    assert np.abs(target[0] - (moved.T_ts @ [*(source[0] + 5.0), 1])[:3]).max() < 1e-4


def test_clouds_of_open3d_and_of_files_are_read_with_their_normals(tmp_path):
    points = surface()
    normals = np.tile([0.0, 0.0, -1.0], (len(points), 1))
    expected = hi.align(points, points, source_normals=normals, target_normals=normals)
    np.save(tmp_path / "cloud.npy", np.hstack([points, normals]).astype(np.float32))
    for cloud in (SimpleNamespace(points=points, normals=normals), (points, normals)):
        found = hi.align(cloud, cloud)
        assert np.array_equal(found.T_ts, expected.T_ts) and found.warnings == expected.warnings
    bare = SimpleNamespace(points=points, normals=[])
    assert "estimated from 20" in hi.align(bare, (points, None)).warnings[0]
    assert hi.align(*[hi.read_cloud(tmp_path / "cloud.npy")] * 2).fitness == 1.0
    two = ((0.1, 0.2, 0.3), (0.2, 0.1, 0.4))
    assert hi.align(two, two, method="point-to-point").T_ts.shape == (4, 4)


def test_hostile_points_keep_the_pose():
    source = surface()
    for bad in [np.empty((0, 3)), np.full((9, 3), np.nan), np.zeros((5, 3))]:
        result = hi.align(source, bad)
        assert np.array_equal(result.T_ts, np.eye(4))
        assert (result.outcome, result.termination) == ("kept_initial", "no_pairs")
        assert result.rmse is None and result.covariance is None and result.warnings
    assert "may be in another unit" in hi.align(1000 * source, source).warnings[2]
    for arguments, text in [
        ({"method": "icp"}, "no registration is named"),
        ({"voxel": 0.0}, "voxel is 0, expected a finite number above 0, meters"),
        ({"neighbors": 2}, "neighbors is 2, expected at least 3"),
        ({"source_normals": source[1:]}, "expected one normal per point"),
        ({"T_ts": np.zeros((4, 4))}, "T_ts"),
    ]:
        with pytest.raises(hi.InputError, match=text):
            hi.align(source, source, **arguments)


def test_other_units_are_named():
    source = surface()
    motion = pose([0.01, -0.01, 0.005], [0.2, 0.2, -0.1])
    target = source @ motion[:3, :3].T + motion[:3, 3]
    millimeters = motion.copy()
    millimeters[:3, 3] *= 1000
    texts = hi.align(1000 * source, 1000 * target, millimeters).warnings
    assert "T_ts looks like millimeters" in texts[0]
    texts = hi.align(source, target, motion, max_distance=5).warnings
    assert "max_distance is 5.0000 m, more than the extent of the target" in texts[0]
    texts = hi.align(source, target, motion, voxel=2).warnings
    assert "voxel is 2.0000 m, more than the extent of the source" in texts[0]
    assert "extent of the target" in texts[1]
    assert not any("check T_ts" in text for text in texts)
    texts = hi.align(source, target + 9).warnings
    assert any("check T_ts, that it and the points are in meters" in text for text in texts)
    right = hi.align(source, target, motion, max_distance=0.05, voxel=0.002).warnings
    assert not any("meters" in text for text in right)


def test_points_at_zero_are_skipped():
    source = surface()
    expected = hi.align(source, source)
    result = hi.align(np.vstack([np.zeros((400, 3)), source]), source)
    assert result.fitness == expected.fitness
    assert "source: 400 points were skipped" in result.warnings[0]


def test_clouds_of_files_are_read_in_meters(tmp_path):
    points = surface().astype(np.float32)
    up = np.tile([0, 0, 1], (len(points), 1))
    np.savetxt(tmp_path / "cloud.xyz", np.hstack([1000 * points, up]))
    read, normals = hi.read_cloud(tmp_path / "cloud.xyz", "mm")
    assert np.allclose(read, points, atol=1e-6) and np.array_equal(normals[0], [0, 0, 1])
    np.save(tmp_path / "cloud.npy", points)
    read, normals = hi.read_cloud(tmp_path / "cloud.npy")
    assert np.array_equal(read, points) and normals is None
    with pytest.raises(hi.FileError, match="missing.ply"):
        hi.read_cloud("missing.ply")


def test_a_cloud_becomes_an_observation(scene):
    v, u = np.nonzero(scene.depth)
    z = scene.depth[v, u].astype(float)
    K = scene.camera.K
    points = np.stack([(u - K[0, 2]) / K[0, 0] * z, (v - K[1, 2]) / K[1, 1] * z, z], axis=1)
    image = hi.DepthImage.from_points(np.vstack([points, [[np.nan] * 3]]), scene.camera)
    assert np.abs(image.to_numpy() - scene.depth).max() < 1e-6
    moved = pose([0.1, 0.2, 0.3], [1, 2, 3])
    points = points @ moved[:3, :3].T + moved[:3, 3]
    image = hi.DepthImage.from_points(points, scene.camera, np.linalg.inv(moved))
    assert np.abs(image.to_numpy() - scene.depth).max() < 1e-5
    assert hi.Observation(image, image.to_numpy() > 0, scene.camera).n_measured == len(points)


def test_clouds_can_be_far_from_the_origin():
    far = np.array([0, 0, 4000.0])
    pose_of_points = pose([0, 0, 0], -far)
    source = surface()
    result = hi.align(source, source - far, pose_of_points, method="point-to-point")
    assert np.allclose(result.T_ts, pose_of_points, atol=1e-3)
    camera = hi.Camera(100, 100, 31.5, 23.5, 64, 48)
    image = hi.DepthImage.from_points(source + far, camera, pose_of_points)
    assert 0.4 < image.to_numpy().max() < 0.6


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers of POSIX")
def test_a_signal_stops_a_registration():
    x, y = np.random.default_rng(3).uniform(-0.1, 0.1, (2, 30_000))
    points = np.stack([x, y, 0.02 * np.sin(40 * x) * np.cos(30 * y + 5 * x)], axis=1)
    arguments = points, points, pose([0, 0, 0.5], [0.05, 0.05, 0])

    def seconds():
        start = time.monotonic()
        with contextlib.suppress(KeyboardInterrupt):
            hi.align(*arguments, method="point-to-point", max_distance=0.1)
        return time.monotonic() - start

    complete = seconds()
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, complete / 10)
        assert seconds() < complete / 2
    finally:
        signal.signal(signal.SIGALRM, before)
