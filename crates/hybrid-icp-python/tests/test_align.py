"""Registration of two point clouds."""

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


def test_hostile_points_keep_the_pose():
    source = surface()
    for bad in [np.empty((0, 3)), np.full((9, 3), np.nan), np.zeros((5, 3))]:
        result = hi.align(source, bad)
        assert np.array_equal(result.T_ts, np.eye(4))
        assert (result.outcome, result.termination) == ("kept_initial", "no_pairs")
        assert result.rmse is None and result.covariance is None and result.warnings
    for arguments, text in [
        ({"method": "icp"}, "no registration is named"),
        ({"voxel": 0.0}, "voxel is 0, expected a finite number above 0, meters"),
        ({"neighbors": 2}, "neighbors is 2, expected at least 3"),
        ({"source_normals": source[1:]}, "expected one normal per point"),
        ({"T_ts": np.zeros((4, 4))}, "T_ts"),
    ]:
        with pytest.raises(hi.InputError, match=text):
            hi.align(source, source, **arguments)


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
