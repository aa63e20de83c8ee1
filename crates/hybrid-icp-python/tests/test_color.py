"""Tests colors of models and observations."""

import pickle
import struct
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import hybrid_icp as hi

CAMERA = hi.Camera(100, 100, 31.5, 23.5, 64, 48)
WALL = np.full((48, 64), 0.8, np.float32)
PICTURE = np.arange(48 * 64 * 3, dtype=np.uint8).reshape(48, 64, 3)
CORNERS = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
COLORS = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 8, 7]], np.uint8)


class Array:
    def __init__(self, array):
        self.array = array

    def __array__(self, dtype=None, copy=None):
        return self.array


def test_the_color_image_comes_back_and_survives_a_pickle():
    for color in (PICTURE, Array(PICTURE), np.asfortranarray(PICTURE), PICTURE[::-1][::-1]):
        observation = hi.Observation(WALL, None, CAMERA, color=color)
        assert observation.color.dtype == np.uint8
        assert np.array_equal(observation.color, PICTURE)
    twin = pickle.loads(pickle.dumps(observation))
    assert np.array_equal(twin.color, PICTURE)
    plain = hi.Observation(WALL, None, CAMERA)
    assert plain.color is None and pickle.loads(pickle.dumps(plain)).color is None


@pytest.mark.parametrize(
    ("color", "message"),
    [
        (PICTURE[:, :, 0], r"color is an array of uint8 with shape \(48, 64\), expected .*\(48, 64, 3\)"),
        (PICTURE[:24], r"color is an array of uint8 with shape \(24, 64, 3\), expected .*\(48, 64, 3\)"),
        (PICTURE.swapaxes(0, 1), r"shape \(64, 48, 3\), expected .* the size of depth, \(48, 64, 3\)"),
        (PICTURE / 255, "color is an array of float64 .* expected an array of uint8"),
        ("rgb.png", "color is a str, expected an array of uint8"),
        (np.ma.masked_array(PICTURE), "color is a masked array"),
    ],
)
def test_errors_of_color_images_name_the_value(color, message):
    with pytest.raises(hi.InputError, match=message):
        hi.Observation(WALL, None, CAMERA, color=color)


def colors_of(model):
    """Returns the colors that a pickle stores."""
    return model.__getnewargs_ex__()[1].get("colors")


def test_vertex_colors_and_textures_survive_a_pickle():
    assert not hi.Model(CORNERS, FACES).has_color
    model = hi.Model(CORNERS, FACES, colors=COLORS)
    assert model.has_color and np.array_equal(colors_of(model), COLORS)
    twin = pickle.loads(pickle.dumps(model))
    assert np.array_equal(colors_of(twin), COLORS)
    assert hi.Model(CORNERS, FACES, colors=COLORS.tolist()).has_color

    places = np.random.default_rng(1).uniform(size=(2, 3, 2)).astype(np.float32)
    model = hi.Model(CORNERS, FACES, colors=([PICTURE, PICTURE[:5]], [1, 0], places))
    images, indices, corners = colors_of(pickle.loads(pickle.dumps(model)))
    assert np.array_equal(images[0], PICTURE) and images[1].shape == (5, 64, 3)
    assert indices.tolist() == [1, 0] and np.array_equal(corners, places)


@pytest.mark.parametrize(
    ("colors", "message"),
    [
        (COLORS[:3], "mesh has 3 vertex colors, expected 4"),
        (COLORS / 255, r"colors is an array of float64 .* expected a \(V, 3\) array of uint8"),
        (COLORS[:, :2], r"colors is .* shape \(4, 2\), expected a \(V, 3\) array of uint8"),
        (([PICTURE], [0, 1], np.zeros((2, 3, 2))), "triangle 1 uses texture 1"),
        (([PICTURE], [0, 0], np.zeros((2, 3))), r"colors\[2\] is .* expected an \(F, 3, 2\)"),
        (([PICTURE[0]], [0, 0], np.zeros((2, 3, 2))), r"colors\[0\] is .* expected an \(H, W, 3\)"),
    ],
)
def test_errors_of_model_colors_name_the_value(colors, message):
    with pytest.raises(hi.InputError, match=message):
        hi.Model(CORNERS, FACES, colors=colors)


def test_colors_of_files_are_read(tmp_path):
    path = tmp_path / "a.ply"
    names = ["float x", "float y", "float z", "uchar red", "uchar green", "uchar blue"]
    head = "".join(f"property {name}\n" for name in names)
    path.write_bytes(
        f"ply\nformat binary_little_endian 1.0\nelement vertex 4\n{head}element face 2\n"
        "property list uchar int vertex_indices\nend_header\n".encode()
        + b"".join(struct.pack("<fffBBB", *p, *c) for p, c in zip(CORNERS, COLORS.tolist()))
        + b"".join(struct.pack("<Biii", 3, *face) for face in FACES)
    )
    model = hi.Model.from_file(path, unit="m")
    assert model.has_color and np.array_equal(colors_of(model), COLORS)


class Visual:
    def __init__(self, **attributes):
        self.__dict__.update(attributes)


def test_colors_of_trimesh_are_kept():
    mesh = Visual(vertices=CORNERS, faces=FACES)
    assert not hi.Model.from_trimesh(mesh, unit="m").has_color
    alpha = np.hstack([COLORS, np.full((4, 1), 255, np.uint8)])
    mesh.visual = Visual(kind="vertex", vertex_colors=alpha)
    assert np.array_equal(colors_of(hi.Model.from_trimesh(mesh, unit="m")), COLORS)
    image = Visual(convert=lambda mode: PICTURE)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    mesh.visual = Visual(kind="texture", uv=uv, material=Visual(image=image))
    images, indices, corners = colors_of(hi.Model.from_trimesh(mesh, unit="m"))
    assert np.array_equal(images[0], PICTURE) and indices.tolist() == [0, 0]
    assert corners[0].tolist() == [[0, 1], [1, 1], [1, 0]]
    mesh.visual = Visual(kind=None)
    assert not hi.Model.from_trimesh(mesh, unit="m").has_color


class Intrinsic:
    width, height, intrinsic_matrix = 64, 48, CAMERA.K


def test_color_images_of_open3d_are_read():
    color = Array(PICTURE)
    observation = hi.Observation.from_open3d(Array(WALL), Intrinsic, color=color)
    assert np.array_equal(observation.color, PICTURE)
    # An RGBDImage has both; its color can be gray.
    pair = SimpleNamespace(depth=memoryview(WALL), color=memoryview(PICTURE))
    observation = hi.Observation.from_open3d(pair, Intrinsic)
    assert np.array_equal(observation.color, PICTURE)
    pair.color = np.zeros(WALL.shape, np.float32)
    assert hi.Observation.from_open3d(pair, Intrinsic).color is None
    with pytest.raises(hi.InputError, match="scale is 1000, .* pass 1 / depth_scale"):
        hi.Observation.from_open3d(WALL, Intrinsic, scale=1000)


def test_colors_of_open3d_meshes_are_read():
    corners, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    mesh = SimpleNamespace(vertices=corners, triangles=faces, has_vertex_colors=lambda: False)
    assert not hi.Model.from_open3d(mesh, unit="m").has_color
    mesh.has_vertex_colors = lambda: True
    mesh.vertex_colors = [[1.0, 0.0, 0.5]] * 3
    model = hi.Model.from_open3d(mesh, unit="cm")
    assert model.has_color and model.diameter == pytest.approx(np.sqrt(2) / 100)


def painted_box():
    """Returns a box of 16 × 16 × 4 cm and the picture on its square sides, of 8 × 8 patches."""
    signs = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)])
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    faces = np.array([corners for a, b, c, d in quads for corners in ([a, b, c], [a, c, d])])
    patches = np.random.default_rng(3).integers(40, 200, (8, 8, 3), dtype=np.uint8)
    picture = patches.repeat(8, axis=0).repeat(8, axis=1)
    places = (signs[faces][:, :, :2] + 1) / 2
    colors = ([picture], np.zeros(12, int), places)
    return hi.Model(signs * [0.08, 0.08, 0.02], faces, colors=colors), picture


def test_colors_tell_the_sides_of_a_square_apart_and_return_their_margin():
    model, picture = painted_box()
    camera = hi.Camera(200, 200, 79.5, 59.5, 160, 120)
    # Seen from the front at 0.5 m, the near square covers the pixels whose rays meet it.
    v, u = np.mgrid[:120, :160]
    place = np.stack((v - 59.5, u - 79.5)) * 0.48 / 200
    seen = (abs(place) < 0.08).all(axis=0)
    depth = np.where(seen, 0.48, 0).astype(np.float32)
    row, column = np.clip((place / 0.16 + 0.5) * 64, 0, 63).astype(int)
    rough = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1]], float)
    pipeline = hi.Pipeline.preset("color")

    colored = hi.Observation(depth, seen, camera, color=picture[row, column])
    result = pipeline.refine(model, colored, rough)
    assert np.allclose(result.T_co[:3, :3], np.eye(3), atol=0.02)
    [margin] = [a.color_gap for a in result.alternatives if np.allclose(a.T_co, rough)]
    assert 0.15 < margin <= 2 and not any("ambiguous" in text for text in result.warnings)
    assert result.to_dict()["alternatives"][0]["color_gap"] == result.alternatives[0].color_gap

    # The far square, seen from behind, shows the mirrored picture.
    mirrored = hi.Observation(depth, seen, camera, color=picture[63 - row, column])
    result = pipeline.refine(model, mirrored, rough)
    assert np.allclose(result.T_co[:3, :3], np.diag([1, -1, -1]), atol=0.02)

    # Neither another picture nor an image without colors tells the sides apart.
    other = np.random.default_rng(4).integers(40, 200, (8, 8, 3), dtype=np.uint8)
    other = hi.Observation(depth, seen, camera, color=other[row // 8, column // 8])
    for observation in (other, hi.Observation(depth, seen, camera)):
        result = pipeline.refine(model, observation, rough)
        assert np.array_equal(result.T_co, rough) and result.alternatives
        assert all(other.color_gap is None for other in result.alternatives)


def test_colors_that_are_missing_cause_a_warning():
    colored, plain = (hi.Model(CORNERS, FACES, colors=colors) for colors in (COLORS, None))
    gray, painted = (hi.Observation(WALL, None, CAMERA, color=color) for color in (None, PICTURE))
    pose = np.eye(4)
    pose[2, 3] = 0.8
    for pipeline in (hi.Pipeline("color"), hi.Pipeline.from_toml(hi.Pipeline("color").toml)):
        with pytest.warns(hi.InputWarning, match=r"the model has no colors .* uses depth alone"):
            pipeline.refine(plain, painted, pose)
        with pytest.warns(hi.InputWarning, match=r"the observation has no color image .color=."):
            pipeline.refine_batch(colored, gray, pose[None])
    with pytest.warns(hi.InputWarning, match=r"no colors .* Pipeline\('local'\) uses depth alone"):
        hi.Pipeline("local").estimate(plain, painted)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        hi.Pipeline("local").refine(plain, painted, pose)
        hi.Pipeline("color").refine(colored, painted, pose)
    assert not any("color" in str(warning.message) for warning in caught)
