"""Compares scores and errors with a reference, and steps with linear algebra and Open3D."""

import bop_errors
import numpy as np
import pytest

import hybrid_icp as hi
from conftest import many, pose


def split(matrix):
    return matrix[:3, :3], matrix[:3, 3]


def test_a_render_matches_ray_casting(scene):
    ours = hi.render_depth(scene.model, scene.camera, scene.rough)
    vertices, faces = scene.model.vertices.astype(float), scene.model.faces
    rays = bop_errors.render(vertices, faces, split(scene.rough), scene.camera.K, ours.shape)
    assert ours.dtype == np.float32
    both = (ours > 0) & (rays > 0)
    assert both.sum() > 2500 and ((ours > 0) != (rays > 0)).mean() < 1e-3
    # At the edge between two surfaces, rounding decides.
    assert (np.abs(ours - rays)[both] > 1e-5).mean() < 2e-3


def test_vsd_matches_its_definition(scene):
    shape = scene.depth.shape
    vertices, faces = scene.model.vertices.astype(float), scene.model.faces
    measured, K = scene.depth.astype(float), scene.camera.K
    truth = bop_errors.render(vertices, faces, split(scene.true), K, shape)
    for estimate in many(scene, 5):
        rendered = bop_errors.render(vertices, faces, split(estimate), K, shape)
        expected, union = bop_errors.vsd(
            measured, rendered, truth, (split(estimate), split(scene.true)), K,
            scene.model.diameter, 0.015,
        )
        found = hi.vsd(scene.model, scene.observation, estimate, scene.true)
        assert found.shape == (10,) and union > 2500
        assert np.abs(found - expected).max() < 2e-3


def test_pose_errors_match_their_definitions(scene):
    symmetry = pose([0, 0, np.pi], [0.003, 0.001, 0])
    model = hi.Model(scene.model.vertices, scene.model.faces, symmetries=[symmetry])
    motions = [(np.eye(3), np.zeros(3)), split(symmetry)]
    for estimate in [*many(scene, 3), scene.true @ symmetry]:
        expected = bop_errors.point_errors(
            model.vertices.astype(float), motions, split(estimate), split(scene.true),
            scene.camera.K,
        )
        found = (
            hi.mssd(estimate, scene.true, model),
            hi.mspd(estimate, scene.true, model, scene.camera),
            hi.add(estimate, scene.true, model),
            hi.adi(estimate, scene.true, model),
        )
        assert np.allclose(found, expected, rtol=1e-6, atol=1e-9)


def test_units_of_symmetries_follow_the_model(scene):
    symmetry = pose([0, 0, np.pi], [0.003, 0.001, 0])
    symmetry_mm = symmetry.copy()
    symmetry_mm[:3, 3] *= 1000
    axis = [([0, 0, 1], [0.01, 0, 0])]
    meters = hi.Model(
        scene.model.vertices, scene.model.faces, symmetries=[symmetry], symmetry_axes=axis,
        diameter=0.2,
    )
    millimeters = hi.Model(
        scene.model.vertices * np.float64(1000), scene.model.faces, symmetries=[symmetry_mm],
        symmetry_axes=[([0, 0, 1], [10, 0, 0])], diameter=200, unit="mm",
    )
    assert np.isclose(meters.diameter, millimeters.diameter)
    errors = [hi.mssd(scene.rough, scene.true, model) for model in (meters, millimeters)]
    assert np.isclose(*errors, rtol=1e-4)
    assert errors[0] < hi.mssd(scene.rough, scene.true, scene.model)
    with pytest.warns(hi.InputWarning, match="a declared symmetry moves the object's center by"):
        hi.Model(scene.model.vertices, scene.model.faces, symmetry_axes=[([0, 0, 1], [10, 0, 0])])


def pairs(seed=3, count=200):
    """Returns points, their motion with noise, and normals, all representable in float32."""
    random = np.random.default_rng(seed)
    targets = random.uniform(-0.1, 0.1, (count, 3)) + [0.02, -0.05, 0.6]
    normals = random.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    motion = pose([0.02, -0.03, 0.01], [0.004, -0.002, 0.003])
    sources = targets @ motion[:3, :3].T + motion[:3, 3] + random.normal(0, 1e-3, (count, 3))
    return [a.astype(np.float32).astype(np.float64) for a in (sources, targets, normals)]


def twist(increment):
    """Returns the logarithm of a motion, [rho; phi]."""
    rotation, translation = split(increment)
    angle = np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))
    hat = (rotation - rotation.T) * angle / (2 * np.sin(angle))
    left = np.eye(3) + (1 - np.cos(angle)) / angle**2 * hat
    left += (angle - np.sin(angle)) / angle**3 * hat @ hat
    return np.concatenate([np.linalg.solve(left, translation), [hat[2, 1], hat[0, 2], hat[1, 0]]])


def test_a_point_to_point_step_is_kabsch():
    sources, targets, _ = pairs()
    increment, loss = hi.point_to_point_step(sources, targets)
    p, c = sources.mean(0), targets.mean(0)
    u, _, vt = np.linalg.svd((sources - p).T @ (targets - c))
    rotation = vt.T @ np.diag([1, 1, np.linalg.det(vt.T @ u.T)]) @ u.T
    assert np.allclose(increment[:3, :3], rotation, atol=1e-8)
    assert np.allclose(increment[:3, 3], c - rotation @ p, atol=1e-8)
    assert np.isclose(loss, ((sources - targets) ** 2).sum(1).mean(), rtol=1e-6)


def test_a_point_to_plane_step_is_least_squares():
    sources, targets, normals = pairs()
    increment, loss = hi.point_to_plane_step(sources, targets, normals)
    rows = np.hstack([normals, np.cross(sources, normals)])
    residuals = ((sources - targets) * normals).sum(1)
    solution = np.linalg.lstsq(rows, -residuals, rcond=None)[0]
    assert np.allclose(twist(increment), solution, atol=1e-7)
    assert np.isclose(loss, (residuals**2).mean(), rtol=1e-5)


def test_steps_that_are_not_determined_are_refused():
    one = np.ones((1, 3))
    with pytest.raises(hi.InputError, match="the 1 pairs do not determine a step"):
        hi.point_to_plane_step(one, one, one)
    with pytest.raises(hi.InputError, match="targets has 2 rows but sources has 1"):
        hi.point_to_point_step(one, np.ones((2, 3)))
    with pytest.raises(hi.InputError, match=r"normals\[0\] has no direction"):
        hi.point_to_plane_step(one, one, one * 0)
    with pytest.raises(hi.InputError, match=r"sources\[0, 1\] is NaN"):
        hi.point_to_point_step([[0, np.nan, 0]], one)


@pytest.fixture(scope="module")
def open3d():
    try:
        import open3d
    except (ImportError, OSError) as error:
        pytest.skip(f"no Open3D: {error}")
    return open3d


def clouds(open3d):
    sources, targets, normals = pairs()
    make = open3d.geometry.PointCloud
    source, target = (make(open3d.utility.Vector3dVector(points)) for points in (sources, targets))
    target.normals = open3d.utility.Vector3dVector(normals)
    indices = np.arange(len(sources), dtype=np.int32)
    same = open3d.utility.Vector2iVector(np.repeat(indices[:, None], 2, 1))
    return (sources, targets, normals), (source, target, same)


def test_a_point_to_point_step_matches_open3d(open3d):
    (sources, targets, _), theirs = clouds(open3d)
    estimation = open3d.pipelines.registration.TransformationEstimationPointToPoint()
    difference = hi.point_to_point_step(sources, targets)[0]
    difference -= estimation.compute_transformation(*theirs)
    assert np.abs(difference).max() < 1e-6


def test_a_point_to_plane_step_matches_open3d(open3d):
    (sources, targets, normals), theirs = clouds(open3d)
    estimation = open3d.pipelines.registration.TransformationEstimationPointToPlane()
    matrix = estimation.compute_transformation(*theirs)
    # Open3D uses the rotation of the solution as angles around z, y and x, and the translation
    # unchanged. We use the exponential map.
    r = matrix[:3, :3]
    angles = [np.arctan2(r[2, 1], r[2, 2]), np.arcsin(-r[2, 0]), np.arctan2(r[1, 0], r[0, 0])]
    solution = np.concatenate([matrix[:3, 3], angles])
    increment, _ = hi.point_to_plane_step(sources, targets, normals)
    assert np.abs(twist(increment) - solution).max() < 1e-6
