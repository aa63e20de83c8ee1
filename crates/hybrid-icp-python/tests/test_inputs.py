"""Tests the checks of arguments and their messages."""

import os
import pickle
import warnings

import numpy as np
import pytest

import hybrid_icp as hi
from conftest import bracket, pose, write_png

CAMERA = hi.Camera(100, 100, 31.5, 23.5, 64, 48)
WALL = np.full((48, 64), 0.8, np.float32)


@pytest.mark.parametrize(
    ("arguments", "scale", "message"),
    [
        ((WALL * 1000, None, CAMERA), None, "depth looks like millimeters: median 800, expected meters"),
        ((WALL / 1000, None, CAMERA), None, "depth looks too small for meters: median 8[.0-9]*e-4, expected at least 0.01"),
        ((WALL.astype(np.uint16), None, CAMERA), None, r"depth is an array of uint16 with shape \(48, 64\) without scale="),
        ((WALL, None, CAMERA), 0.001, r"scale=0.001 was passed with depth as an array of float32"),
        ((WALL.astype(np.uint16), None, CAMERA), -1.0, "scale is -1, expected meters per unit above 0"),
        ((WALL.astype(np.int32), None, CAMERA), None, "depth is an array of int32 .* expected an .H, W. array of float32 meters"),
        ((WALL[None], None, CAMERA), None, r"depth is an array of float32 with shape \(1, 48, 64\)"),
        ((WALL.tolist(), None, CAMERA), None, "depth is a list, expected"),
        ((WALL.T, None, CAMERA), None, r"camera is for 64x48 images but depth is .* shape \(64, 48\), expected shape \(48, 64\); the size of a camera is"),
        ((WALL, np.ones((64, 48), bool), CAMERA), None, r"mask is .* shape \(64, 48\), expected the shape of depth, \(48, 64\)"),
        ((hi.DepthImage(WALL.T), None, CAMERA), None, r"depth is a DepthImage with shape \(64, 48\), expected shape \(48, 64\)"),
        ((hi.DepthImage(WALL), None, CAMERA), 0.001, "scale= was passed with depth as a DepthImage, .* expected scale= where"),
        ((hi.DepthImage(WALL), np.ones((64, 48), bool), CAMERA), None, r"mask is .* expected the shape of depth, \(48, 64\)"),
        ((WALL, "mask.png", CAMERA), None, "mask is a str, expected .*; read_mask reads a file"),
        ((WALL, WALL, CAMERA), None, "mask is an array of float32 .* expected an .H, W. array of bool or uint8.*; pass mask > 0.5 for probabilities"),
    ],
)
def test_observation_errors_name_the_value(arguments, scale, message):
    with pytest.raises(hi.InputError, match=message):
        hi.Observation(*arguments, scale=scale)


@pytest.mark.parametrize("depth", [WALL, WALL.astype(np.float64), (WALL * 1000).astype(np.uint16)])
def test_a_last_axis_of_length_one_is_dropped(depth):
    scale = 0.001 if depth.dtype == np.uint16 else None
    mask = np.zeros((48, 64), np.uint8)
    mask[10:20, 10:30] = 255
    flat = hi.Observation(depth, mask, CAMERA, scale=scale)
    image = hi.Observation(depth[..., None], mask[..., None], CAMERA, scale=scale)
    assert np.array_equal(image.depth, flat.depth) and np.array_equal(image.mask, flat.mask)
    assert np.array_equal(hi.DepthImage(depth[..., None], scale=scale).to_numpy(), flat.depth)
    with pytest.raises(hi.InputError, match=r"shape \(48, 64, 3\)"):
        hi.Observation(WALL, np.repeat(mask[..., None], 3, axis=2), CAMERA)


def test_the_window_of_normals_is_a_setting_that_survives_a_pickle():
    # Two columns of five pixels: the 3 x 3 windows of the four outer pixels have fewer than six.
    strip = np.zeros((48, 64), bool)
    strip[10:15, 20:22] = True
    assert hi.Observation(WALL, strip, CAMERA).n_surfels == 10
    small = hi.Observation(WALL, strip, CAMERA, normal_window=1)
    assert small.n_surfels == 6 and pickle.loads(pickle.dumps(small)).n_surfels == 6
    with pytest.raises(hi.InputError, match="half side of 11 pixels, expected 1 to 10"):
        hi.Observation(WALL, strip, CAMERA, normal_window=11)


def test_units_are_checked_even_if_few_pixels_were_measured():
    # Two pixels outside the grid that the check of the unit reads first.
    sparse = np.zeros((480, 640), np.float32)
    sparse[[1, 300], [2, 401]] = 823
    with pytest.raises(hi.InputError, match="depth looks like millimeters: median 823"):
        hi.DepthImage(sparse)
    assert hi.DepthImage(sparse / 1000).to_numpy().sum() == np.float32(0.823) * 2
    assert not hi.DepthImage(np.full((48, 64), np.nan, np.float32)).to_numpy().any()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.eye(3), r"T_co is an array of float64 with shape \(3, 3\), expected a \(4, 4\) float64 matrix"),
        ("pose", "T_co is a str, expected .*; read_pose reads a file"),
        (None, "T_co is None, expected"),
        ([[1, 2]], r"T_co is a list of shape \(1, 2\), expected"),
        (np.eye(4) * 2, "last row of a pose is 0 0 0 1"),
        (np.diag([1, 1, -1, 1.0]), "T_co: rotation has determinant -1"),
        (np.diag([1, 1.1, 1, 1.0]), "T_co: rotation is not orthogonal"),
        (pose([0, 0, 0], [3, 4, 800]), "T_co looks like millimeters: its translation is \\(3, 4, 800\\)"),
        (pose([0, 0, 0], [np.nan, 0, 1]), "T_co has the translation \\(NaN, 0, 1\\)"),
    ],
)
def test_pose_errors_name_the_value(scene, value, message):
    with pytest.raises(hi.InputError, match=message):
        hi.Pipeline.preset("hybrid").refine(scene.model, scene.observation, value)


def test_a_batch_names_the_pose_that_is_wrong(scene):
    poses = np.array([scene.rough, scene.rough * 2])
    hybrid = hi.Pipeline.preset("hybrid")
    with pytest.raises(hi.InputError, match=r"T_co\[1\]\[3, 3\] is 2, expected 1"):
        hybrid.refine_batch(scene.model, scene.observation, poses)
    with pytest.raises(hi.InputError, match=r"shape \(4, 4\), expected an \(N, 4, 4\)"):
        hybrid.refine_batch(scene.model, scene.observation, scene.rough)
    for threads in (0, -1):
        with pytest.raises(hi.InputError, match=f"threads is {threads}, expected 1 or more"):
            hybrid.refine_batch(scene.model, scene.observation, poses[:1], threads=threads)


def test_frames_and_units_that_do_not_match_cause_a_warning(scene):
    pipeline = hi.Pipeline.preset("hybrid")
    with pytest.warns(hi.InputWarning, match="behind the camera, .* not object from camera, nor .* OpenGL"):
        pipeline.refine(scene.model, scene.observation, pose([0, 0, 0], [0, 0, -0.5]))
    message = "at z = 5.0.* but the median depth inside the mask is 0.[45]"
    with pytest.warns(hi.InputWarning, match=message):
        pipeline.refine(scene.model, scene.observation, pose([0, 0, 0], [0, 0, 5]))
    vertices, faces = bracket()
    with pytest.warns(hi.InputWarning, match='diameter is 1.*: check unit="m"'):
        hi.Model(vertices, faces)


def test_masks_that_do_not_fit_the_object_cause_a_warning(scene):
    def warns(message, model, observation):
        pipeline = hi.Pipeline("local")
        runs = [lambda: pipeline.refine(model, observation, scene.true)]
        runs += [lambda: pipeline.refine_batch(model, observation, scene.true[None])]
        runs += [lambda: pipeline.judge(model, observation, scene.true)]
        for run in [*runs, lambda: pipeline.estimate(model, observation)]:
            with pytest.warns(hi.InputWarning, match=message):
                run()

    vertices, faces = bracket()
    small = hi.Model(vertices / 10, faces, unit="mm")
    warns("the mask has .* covers at most .*: check unit= of the model", small, scene.observation)
    large = hi.Model(vertices, faces, unit="cm")
    warns("the mask has .* covers .*: check unit= of the model", large, scene.observation)
    nothing = np.zeros_like(scene.mask)
    empty = hi.Observation(scene.depth, nothing, scene.camera)
    warns("the mask is empty, expected pixels", scene.model, empty)
    unmeasured = hi.Observation(scene.depth * ~scene.mask, scene.mask, scene.camera)
    warns("no depth inside the mask: check scale=", scene.model, unmeasured)
    swapped = hi.Camera(300, 305, 121, 159.5, 320, 240)
    swapped = hi.Observation(scene.depth, scene.mask, swapped)
    warns("if cx and cy were swapped", scene.model, swapped)
    with pytest.warns(hi.InputWarning, match=r"bbox \(200, .* not two corners"):
        hi.mask_in_box((200, 100, 260, 180), scene.camera)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hi.Pipeline("local").estimate(scene.model, scene.observation)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hi.Model(np.zeros((3, 2)), [[0, 1, 2]]), r"vertices is .* shape \(3, 2\), expected a \(V, 3\) array"),
        (lambda: hi.Model(np.eye(3), None), "faces is None, expected .* not a point cloud"),
        (lambda: hi.Model(np.eye(3), np.zeros((1, 3))), "faces is an array of float64 .* expected an .F, 3. array of integers"),
        (lambda: hi.Model(np.eye(3), [[0.9, 1.2, 2.7]]), "faces is an array of float64 .* expected an .F, 3. array of integers"),
        (lambda: hi.Model(np.eye(3), [[0, 1, 2]], samples=10**12), "samples is 1000000000000, expected at most 10000000"),
        (
            lambda: hi.Model(np.eye(3), [[0, 1, 2]], symmetry_axes=[[0, 0, 1]]),
            r"symmetry_axes is a list, expected pairs of a direction and a point",
        ),
        (
            lambda: hi.Model(np.eye(3), [[0, 1, 2]], symmetry_axes=[([0, 0, 1], [0, 0, 0])] * 4000),
            "define 1260000 motions, expected at most 1000000",
        ),
        (lambda: hi.Model(np.eye(3), [[0, 1, -1]]), r"faces\[0\] has the index -1, expected 0 or more"),
        (lambda: hi.Model(np.eye(3), [[0, 1, 3]]), "triangle 0 uses vertex 3, but there are 3 vertices"),
        (lambda: hi.Model(np.eye(3), [[0, 1, 2]], unit="inch"), 'unit is "inch", expected m, mm or cm'),
        (lambda: hi.Model(np.eye(3), [[0, 1, 2]], diameter=-1), "diameter is -1, expected"),
        (lambda: hi.Camera(0, 1, 0, 0, 4, 4), "focal length fx is 0, expected"),
        (lambda: hi.Camera.from_K(np.eye(4), (4, 4)), r"K is an array of float64 with shape \(4, 4\)"),
        (lambda: hi.Camera.from_K([[1, 5, 0], [0, 1, 0], [0, 0, 1]], (4, 4)), r"camera matrix entry \[0\]\[1\] is 5"),
        (lambda: hi.Pipeline.preset("hybird"), 'no pipeline is named "hybird"; did you mean "hybrid"'),
        (lambda: hi.Pipeline.from_toml('type = "icq"'), 'did you mean "icp"'),
        (lambda: hi.Pipeline.from_toml(3), "text_or_path is an int, expected"),
        (lambda: hi.Fuser("averag"), 'no fusion method is named "averag"'),
        (lambda: hi.PoseEstimate(np.eye(4), -np.eye(6)), "covariance has the eigenvalue"),
        (lambda: hi.fuse([]), "no estimate to fuse"),
        (lambda: hi.mask_in_box([1, 2, 3], CAMERA), r"bbox .*expected four numbers"),
        (lambda: hi.mask_in_box([64, 0, 9, 9], CAMERA), r"bbox is \(64, .* in a 64x48 image"),
    ],
)
def test_other_errors_name_the_value(make, message):
    with pytest.raises(hi.InputError, match=message) as raised:
        make()
    assert isinstance(raised.value, ValueError) and isinstance(raised.value, hi.HybridIcpError)


def test_files_that_cannot_be_read_are_named(tmp_path):
    broken = tmp_path / "broken.obj"
    broken.write_text("v 0 0 zero\n")
    for make, message in [
        (lambda: hi.Model.from_file(tmp_path / "none.ply", unit="mm"), "cannot read .*none.ply"),
        (lambda: hi.Model.from_file(broken, unit="mm"), "broken.obj"),
        (lambda: hi.read_depth_png(tmp_path / "none.png", 0.001), "none.png"),
        (lambda: hi.read_mask_png(tmp_path / "none.png"), "none.png"),
        (lambda: hi.Pipeline.from_toml(tmp_path / "none.toml"), "none.toml"),
    ]:
        with pytest.raises(hi.FileError, match=message) as raised:
            make()
        assert isinstance(raised.value, OSError)


def shifted(array):
    """Returns an equal array that is not aligned."""
    buffer = np.zeros(array.nbytes + 1, np.uint8)
    moved = buffer[1:].view(array.dtype).reshape(array.shape)
    moved[...] = array
    assert not moved.flags.aligned
    return moved


def packed(array):
    """Returns an equal array that is a field of packed records."""
    records = np.zeros(array.shape, dtype=[("valid", "u1"), ("value", array.dtype)])
    records["value"] = array
    assert not records["value"].flags.aligned
    return records["value"]


def test_layouts_and_types_of_arrays_do_not_matter(scene):
    def same(depth, mask, scale=None):
        other = hi.Observation(depth, mask, scene.camera, scale=scale)
        assert np.array_equal(other.depth, expected.depth)
        assert np.array_equal(other.mask, expected.mask)
        assert np.array_equal(other.surfels()[0], expected.surfels()[0])

    expected = scene.observation
    same(np.asfortranarray(scene.depth), np.asfortranarray(scene.mask))
    transposed = np.asfortranarray(scene.rough)
    hybrid = hi.Pipeline.preset("hybrid")
    both = (scene.rough, transposed)
    results = [hybrid.refine(scene.model, expected, T_co).to_dict() for T_co in both]
    assert results[0] == results[1]
    same(np.repeat(scene.depth, 2, axis=1)[:, ::2], np.repeat(scene.mask, 2, axis=0)[::2])
    same(scene.depth.astype(np.float64), scene.mask.astype(np.uint8) * 255)
    for moved in (shifted, packed):
        same(moved(scene.depth), scene.mask)
        same(moved(scene.depth.astype(np.float64)), scene.mask)
        refined = hybrid.refine(scene.model, expected, moved(scene.rough)).to_dict()
        assert refined == results[0]
        vertices, faces = bracket()
        numbers, indices = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
        model = hi.Model(moved(numbers), moved(indices), unit="mm")
        assert np.array_equal(model.vertices, hi.Model(vertices, faces, unit="mm").vertices)
    units = np.round(scene.depth * 10000).astype(np.uint16)
    expected = hi.Observation((units * 0.1 / 1000).astype(np.float32), scene.mask, scene.camera)
    same(units, scene.mask, scale=0.0001)
    same(shifted(units), scene.mask, scale=0.0001)
    same(packed(units), scene.mask, scale=0.0001)
    before = expected.depth
    expected.depth[:] = 0
    assert np.array_equal(expected.depth, before)


def test_observations_of_one_image_share_its_depth(scene):
    image = hi.DepthImage(scene.depth)
    left = scene.mask & (np.arange(320) < 160)
    for mask in (scene.mask, left, None):
        depths = (scene.depth, image)
        apart, shared = (hi.Observation(depth, mask, scene.camera) for depth in depths)
        assert all(map(np.array_equal, apart.surfels(), shared.surfels()))
        assert np.array_equal(shared.depth, image.to_numpy()) and shared.image == image
    again = hi.Observation(shared.image, left, scene.camera)
    assert again.n_measured == left.sum()
    assert (image.width, image.height) == (320, 240) and repr(image) == "DepthImage(320x240)"
    assert image != hi.DepthImage(scene.depth * 2)


def test_masks_of_a_shared_image_use_no_memory_for_depth():
    camera = hi.Camera(1000, 1000, 999.5, 749.5, 2000, 1500)
    image = hi.DepthImage(np.full((1500, 2000), 0.8, np.float32))
    masks = [np.zeros((1500, 2000), bool) for _ in range(20)]
    for index, mask in enumerate(masks):
        mask[:] = False  # Write the mask, so that its memory is resident.
        mask[10 * index : 10 * index + 8, :8] = True

    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")

    if not os.path.exists("/proc/self/statm"):
        pytest.skip("the memory of this process is unknown without /proc")
    before = resident()
    observations = [hi.Observation(image, mask, camera) for mask in masks]
    grown = resident() - before
    # The masks have one byte per pixel, 60 MB in total. A depth image per mask would add 240 MB.
    assert grown < 120e6 and sum(o.n_measured for o in observations) == 20 * 64


def test_an_image_from_a_file_equals_the_array_from_it(tmp_path):
    write_png(tmp_path / "depth.png", np.arange(48 * 64, dtype=np.uint16).reshape(48, 64))
    image = hi.DepthImage.from_png(tmp_path / "depth.png", 0.0001)
    array = hi.read_depth_png(tmp_path / "depth.png", 0.0001)
    assert np.array_equal(image.to_numpy(), array) and image == hi.DepthImage(array)
    with pytest.raises(hi.FileError, match="none.png"):
        hi.DepthImage.from_png(tmp_path / "none.png", 0.0001)


def test_a_scale_in_millimeters_is_found_and_corrected(tmp_path):
    path = tmp_path / "depth.png"
    units = np.full((48, 64), 8000, np.uint16)
    write_png(path, units)
    readers = [lambda: hi.DepthImage.from_png(path, 0.1), lambda: hi.read_depth_png(path, 0.1)]
    readers += [lambda: hi.read_depth(path, scale=0.1), lambda: hi.DepthImage(units, scale=0.1)]
    for read in readers:
        with pytest.raises(hi.InputError, match="median 800, .* pass scale=0.0001"):
            read()
    with pytest.raises(hi.FileError, match="found integers, .* scale= .meters per unit."):
        hi.read_depth(path)
    with pytest.raises(hi.InputError, match="scale is -1, expected meters per unit above 0"):
        hi.read_depth(path, scale=-1)
    with pytest.raises(hi.InputError, match="median 800, .*divide the points by 1000"):
        hi.DepthImage.from_points([[0, 0, 800]], CAMERA)
    with pytest.warns(hi.InputWarning, match="no point is in the image"):
        hi.DepthImage.from_points([[0, 0, -0.8]], CAMERA)


def test_infinite_depth_is_not_measured():
    depth = np.full((48, 64), np.inf, np.float32)
    depth[20:30, 20:30] = 0.8
    image = hi.DepthImage(depth)
    assert np.array_equal(image.to_numpy(), np.where(np.isinf(depth), 0, depth))


def test_observations_share_a_pickled_image():
    image = hi.DepthImage(np.full((48, 64), 0.8, np.float32))
    observations = [hi.Observation(image, None, CAMERA) for _ in range(4)]
    assert observations[0].image is image
    text = pickle.dumps(observations)
    assert len(text) < 2 * len(pickle.dumps(observations[0]))
    twins = pickle.loads(text)
    assert twins[0].image is twins[3].image and twins[0].image == image


def test_files_of_numpy_are_read(tmp_path):
    meters = np.linspace(0.5, 1.5, 48 * 64, dtype=np.float32).reshape(48, 64)
    np.save(tmp_path / "depth.npy", meters)
    assert np.array_equal(hi.read_depth(tmp_path / "depth.npy"), meters)
    units = np.full((48, 64), 800, np.uint16)
    units[0] = 65535  # Saturated, which means missing.
    np.save(tmp_path / "units.npy", units)
    expected = np.where(units == 800, np.float32(0.8), 0)
    assert np.array_equal(hi.read_depth(tmp_path / "units.npy", scale=0.001), expected)
    assert np.array_equal(hi.DepthImage(units, scale=0.001).to_numpy(), expected)
    with pytest.raises(hi.FileError, match="integers"):
        hi.read_depth(tmp_path / "units.npy")
    labels = np.tile(np.arange(4, dtype=np.uint8), (48, 16))
    np.save(tmp_path / "labels.npy", labels)
    assert np.array_equal(hi.read_mask(tmp_path / "labels.npy", value=3), labels == 3)
    assert np.array_equal(hi.read_mask(tmp_path / "labels.npy", threshold=2), labels >= 2)
    with pytest.warns(hi.InputWarning, match="the values 0, 1, 2 and 3.* threshold=2 .* value=N"):
        assert np.array_equal(hi.read_mask(tmp_path / "labels.npy"), labels > 0)
    with pytest.raises(hi.InputError, match="both"):
        hi.read_mask(tmp_path / "labels.npy", threshold=1, value=1)
    pose = np.eye(4)
    pose[:3, 3] = [100, -200, 800]
    np.savetxt(tmp_path / "pose.txt", pose)
    expected = np.diag([1, 1, 1, 1.0])
    expected[:3, 3] = [0.1, -0.2, 0.8]
    assert np.allclose(hi.read_pose(tmp_path / "pose.txt", unit="mm"), expected)
    np.savetxt(tmp_path / "K.txt", CAMERA.K)
    assert hi.Camera.from_file(tmp_path / "K.txt", (64, 48)) == CAMERA


def test_pixel_centers_shift_the_principal_point():
    camera = hi.Camera(100, 100, 32, 24, 64, 48, pixel_centers="halves")
    assert (camera.cx, camera.cy) == (31.5, 23.5) and camera == CAMERA
    assert np.array_equal(camera.K, [[100, 0, 31.5], [0, 100, 23.5], [0, 0, 1]])
