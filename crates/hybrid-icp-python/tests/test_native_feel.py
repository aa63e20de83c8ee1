"""Tests what Python users expect: pickles, foreign arrays, pictures and plain arguments."""

import copy
import json
import math
import pickle
import shutil
import subprocess
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import hybrid_icp as hi
from conftest import ROOT, many


@pytest.fixture(scope="module")
def result(scene):
    return hi.Pipeline().refine(scene.model, scene.observation, scene.rough)


def refine(pipeline, model, observation, T_co):
    return pipeline.refine(model, observation, T_co)


def test_everything_can_be_pickled_and_copied(scene, result):
    symmetric = hi.Model(
        scene.model.vertices,
        scene.model.faces,
        symmetries=[np.diag([-1.0, -1, 1, 1])],
        symmetry_axes=[((0, 0, 1), (0.01, 0, 0))],
    )
    for twin in (lambda x: pickle.loads(pickle.dumps(x)), copy.copy, copy.deepcopy):
        model, observation = twin(scene.model), twin(scene.observation)
        assert np.array_equal(model.vertices, scene.model.vertices)
        assert np.array_equal(model.faces, scene.model.faces)
        assert model.diameter == scene.model.diameter
        assert twin(scene.observation.image) == scene.observation.image
        assert np.array_equal(observation.mask, scene.observation.mask)
        assert observation.camera == scene.camera
        again = twin(hi.Pipeline()).refine(model, observation, scene.rough)
        assert again.to_dict() == result.to_dict() == twin(result).to_dict()
        stage = result.stages[0]
        assert twin(stage).to_dict() == stage.to_dict() and repr(twin(stage)) == repr(stage)
        turned = scene.true @ np.diag([-1.0, -1, 1, 1])
        assert np.allclose(twin(symmetric).nearest_equivalent(turned, scene.true), scene.true)
        estimate = twin(hi.PoseEstimate(scene.true, np.eye(6), mve=0.1))
        assert np.allclose(estimate.T_co, scene.true) and estimate.mve == 0.1


def test_a_process_pool_has_the_bits_of_this_process(scene):
    poses, pipeline = many(scene, 3), hi.Pipeline("local")
    with ProcessPoolExecutor(2) as pool:
        jobs = [
            pool.submit(refine, pipeline, scene.model, scene.observation, pose) for pose in poses
        ]
        remote = [job.result().to_dict() for job in jobs]
    here = [refine(pipeline, scene.model, scene.observation, pose).to_dict() for pose in poses]
    assert remote == here


@pytest.mark.parametrize("stop", [False, np.False_, np.bool_(False)])
def test_an_observer_stops_the_run_with_any_false(scene, stop):
    pipeline = hi.Pipeline("projective-point-to-plane")
    arguments = scene.model, scene.observation, scene.rough
    assert pipeline.refine(*arguments, lambda event: stop).termination == "stopped"
    full = pipeline.refine(*arguments)
    for go_on in (None, True, np.True_):
        assert pipeline.refine(*arguments, lambda event, go_on=go_on: go_on).to_dict() == full.to_dict()


@pytest.mark.parametrize("answer", [0, "no", [], np.zeros(2)])
def test_other_answers_of_an_observer_are_refused(scene, answer):
    with pytest.raises(hi.InputError, match="the observer returned .*, expected True, None, or False"):
        hi.Pipeline().refine(scene.model, scene.observation, scene.rough, lambda event: answer)


class Tensor:
    """An array of another library, on a GPU or not."""

    def __init__(self, values, device="cpu"):
        self.values, self.device = values, device

    def __array__(self, dtype=None, copy=None):
        if self.device != "cpu":
            raise TypeError("can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu().")
        return np.asarray(self.values, dtype)


def test_anything_with_an_array_is_an_array(scene, result):
    observation = hi.Observation(Tensor(scene.depth), Tensor(scene.mask), scene.camera)
    pose = Tensor(scene.rough)
    assert hi.Pipeline().refine(scene.model, observation, pose).to_dict() == result.to_dict()
    gpu = Tensor(scene.depth, "cuda")
    with pytest.raises(hi.InputError, match=r"depth is a Tensor: .*Use Tensor\.cpu"):
        hi.Observation(gpu, scene.mask, scene.camera)
    with pytest.raises(hi.InputError, match="depth is an array of int64 with shape"):
        hi.Observation(Tensor(scene.depth.astype(np.int64)), scene.mask, scene.camera)


def test_masked_arrays_and_label_images_are_caught(scene):
    masked = np.ma.masked_less(scene.depth, 0.1)
    with pytest.raises(hi.InputError, match=r"depth is a masked array, .*depth\.filled"):
        hi.Observation(masked, scene.mask, scene.camera)
    vertices = np.ma.masked_array(scene.model.vertices)
    with pytest.raises(hi.InputError, match="vertices is a masked array"):
        hi.Model(vertices, scene.model.faces)
    with pytest.raises(hi.InputError, match="T_co is an array of <U32"):
        hi.Pipeline().refine(scene.model, scene.observation, scene.rough.astype(str))
    labels = scene.mask.astype(np.uint8)
    labels[:5] = 7
    with pytest.warns(hi.InputWarning, match="mask has 2 values from 1 to 7: expected one object"):
        hi.Observation(scene.depth, labels, scene.camera)


def test_overrides_are_a_dict_or_assignments(scene):
    fields = hi.Pipeline("hybrid", overrides={"times": 3})
    assert fields.name == hi.Pipeline("hybrid", overrides=["times=3"]).name == "hybrid times=3"
    with pytest.raises(hi.InputError, match="overrides is a str, expected a dict such as"):
        hi.Pipeline("hybrid", overrides="times=3")
    with pytest.raises(hi.InputError, match="times"):
        hi.Pipeline("hybrid", overrides={"times": "three"})


def test_fields_accept_the_scalars_of_numpy():
    for number in (np.float64(0.25), np.float32(0.25), np.array(0.25)):
        assert hi.Pipeline(overrides={"threshold": number}).name == "auto threshold=0.25"
    for times in (np.int64(3), np.uint8(3), np.array(3)):
        assert hi.Pipeline("hybrid", overrides={"times": times}).name == "hybrid times=3"
    with pytest.raises(hi.InputError, match="found true, expected"):
        hi.Pipeline("hybrid", overrides={"times": np.True_})
    gate = {"type": "max-distance", "limit": np.float64(0.1), "unit": "meters"}
    parts = {"selection": "visible-surface", "association": "projective", "metric": "point-to-plane"}
    assert "limit = 0.1," in hi.Pipeline.icp(**parts, filter=[gate]).toml
    # The second has a combining accent, which Rust escapes and TOML does not.
    for name in ["Müller's", "Mu\u0308ller", "tab\t and \x7f"]:
        parts["metric"] = name
        with pytest.raises(hi.InputError, match="no metric is named"):
            hi.Pipeline.icp(**parts)


def test_a_pipeline_of_parts_has_the_bits_of_its_file(scene):
    filters = [{"type": "max-distance", "limit": 0.25, "unit": "diameters"}]
    parts = {"selection": "visible-surface", "association": "projective", "metric": "point-to-plane"}
    made = hi.Pipeline.icp(**parts, filter=filters, stop=["convergence", "iteration-limit"])
    text = 'type = "icp"\n' + "".join(f'{name} = "{part}"\n' for name, part in parts.items())
    text += 'filter = [{ type = "max-distance", limit = 0.25, unit = "diameters" }]\n'
    text += 'stop = ["convergence", "iteration-limit"]\n'
    read = hi.Pipeline.from_toml(text)
    runs = [p.refine(scene.model, scene.observation, scene.rough).to_dict() for p in (made, read)]
    assert runs[0] == runs[1]
    with pytest.raises(hi.InputError, match="point-to-plane"):
        hi.Pipeline.icp(**{**parts, "metric": "point-to-plain"})


def test_the_catalog_of_parts_is_that_of_the_documentation():
    page = (ROOT / "docs" / "catalogue.md").read_text(encoding="utf-8")
    parts = hi.parts()
    assert len(parts) == page.count("\n### ") and len(parts) > 30
    for part in parts:
        assert f"### {part['type']} (" in page and part["about"] in page
        for parameter in part["parameters"]:
            assert f"| `{parameter['name']}` |" in page and parameter["meaning"] in page


def test_many_items_have_the_bits_of_single_calls_in_order(scene):
    pipeline = hi.Pipeline("local")
    items = [(scene.model, scene.observation, pose) for pose in many(scene, 5)]
    together = pipeline.refine_many(iter(items), threads=2)
    assert [r.to_dict() for r in together] == [pipeline.refine(*i).to_dict() for i in items]
    assert pipeline.refine_many([]) == []


def test_many_items_are_read_on_demand_and_a_bad_one_is_named(scene):
    pipeline, item = hi.Pipeline("local"), (scene.model, scene.observation, scene.true)
    read = []

    def items():
        for index in range(50):
            read.append(index)
            yield item if index != 1 else (*item[:2], 2 * scene.true)

    with pytest.raises(hi.InputError, match=r"items\[1\]: T_co\[3, 3\] is 2, expected 1"):
        pipeline.refine_many(items(), threads=2)
    assert len(read) <= 7
    with pytest.raises(TypeError, match=r"items\[0\]: "):
        pipeline.refine_many([(scene.model, scene.true)])
    with pytest.raises(hi.InputError, match="threads is 0, expected 1 or more"):
        pipeline.refine_many([item], threads=0)


def test_results_are_plain_values_without_nan(scene):
    wall = np.full_like(scene.depth, 0.7)
    wall[scene.mask] = scene.depth[scene.mask]
    wall[~scene.mask] = 0
    cut = hi.Observation(wall, scene.mask, scene.camera)
    result = hi.Pipeline("local").refine(scene.model, cut, scene.true)
    assert math.isnan(result.evidence["contour"])
    assert result.to_dict()["evidence"]["contour"] is None
    points = scene.model.vertices
    aligned = hi.align(points, points, method="point-to-point")
    step = hi.SequentialEstimator(hi.Pipeline("local"), "average", scene.model, scene.true)
    tracked = hi.Tracker(scene.model, scene.camera, scene.true).step(wall, 0)
    for record in (result, aligned, step.step(scene.observation), tracked):
        text = json.dumps(record.to_dict(), allow_nan=False)
        assert set(json.loads(text)) == set(vars(record)) - {"model"}


def test_an_overlay_and_residuals_show_where_the_pose_is(scene, result):
    painted = result.overlay(scene.observation)
    assert painted.shape == (240, 320, 3) and painted.dtype == np.uint8
    contour = (painted == (0, 220, 0)).all(axis=2)
    assert 50 < contour.sum() < scene.mask.sum()
    photo = np.full((240, 320), 9, np.uint8)
    over = result.overlay(scene.observation, photo)
    assert ((over == (0, 220, 0)).all(axis=2) == contour).all() and (over[~contour] == 9).all()
    with pytest.raises(hi.InputError, match=r"image is an array of float64 .*expected uint8"):
        result.overlay(scene.observation, photo / 255)
    residuals = scene.observation.residuals(result)
    assert residuals.dtype == np.float32 and np.nanmedian(np.abs(residuals)) < 0.001
    sent = pickle.loads(pickle.dumps(result))
    with pytest.raises(hi.InputError, match="expected model="):
        scene.observation.residuals(sent)
    again = scene.observation.residuals(sent, model=scene.model)
    assert np.array_equal(again, residuals, equal_nan=True)


def test_notebooks_show_pictures_and_tables(scene, result):
    for item in (scene.model, scene.observation):
        assert item._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"
    table = result._repr_html_()
    assert "confidence" in table and table.startswith("<table>")


def test_an_equivalent_pose_is_near_the_reference(scene):
    axis = ((0, 0, 1), (0.02, -0.01, 0))
    model = hi.Model(scene.model.vertices, scene.model.faces, symmetry_axes=[axis])
    result = hi.Pipeline("local").refine(model, scene.observation, scene.true)
    for angle in (0.3, 2.0, -3.0):
        turn, offset = np.eye(4), np.array([0.02, -0.01, 0])
        turn[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
        turn[:3, 3] = offset - turn[:3, :3] @ offset
        found = result.canonical_pose(result.T_co @ turn)
        assert np.allclose(found, result.T_co @ turn, atol=1e-9)


def test_models_of_a_dataset_have_their_symmetries(dataset, tmp_path):
    folder = dataset[0]
    numbers = [int(path.stem[4:]) for path in (folder / "models").glob("obj_*.ply")]
    models = [hi.Model.from_bop(folder, number) for number in numbers]
    assert models and all(0.01 < model.diameter < 1 for model in models)
    same = hi.Model.from_bop(folder / "models", numbers[0])
    assert np.array_equal(same.vertices, models[0].vertices)
    with pytest.raises(hi.FileError, match="no model of object 999"):
        hi.Model.from_bop(folder, 999)
    # A folder of other meshes has no models_info.json of its own.
    mesh = next((folder / "models").glob("obj_*.ply"))
    for name in ("models", "models_color"):
        (tmp_path / name).mkdir()
        shutil.copy(mesh, tmp_path / name)
    info = {int(mesh.stem[4:]): {"diameter": 321.0, "symmetries_discrete": []}}
    (tmp_path / "models" / "models_info.json").write_text(json.dumps(info))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hi.InputWarning)
        found = hi.Model.from_bop(tmp_path / "models_color", int(mesh.stem[4:]))
    assert found.diameter == pytest.approx(0.321)


class Mesh:
    def __init__(self, model):
        self.vertices, self.faces = 1000 * model.vertices, model.faces


class Intrinsic:
    def __init__(self, camera):
        self.width, self.height, self.intrinsic_matrix = camera.width, camera.height, camera.K


def test_meshes_and_images_of_other_libraries_are_read(scene):
    model = hi.Model.from_trimesh(Mesh(scene.model), unit="mm")
    assert math.isclose(model.diameter, scene.model.diameter, rel_tol=1e-5)
    millimeters = Tensor((scene.depth * 1000).round().astype(np.uint16))
    for depth in (Tensor(scene.depth), millimeters):
        observation = hi.Observation.from_open3d(depth, Intrinsic(scene.camera), scene.mask)
        assert np.allclose(observation.depth, scene.depth, atol=6e-4)
        assert observation.camera == scene.camera


def test_images_with_a_buffer_are_read(scene):
    """As those of Open3D, which are no arrays."""
    depth, mask = memoryview(scene.depth), memoryview(scene.mask)
    observation = hi.Observation(depth, mask, scene.camera)
    assert np.array_equal(observation.depth, scene.depth)
    assert np.array_equal(observation.mask, scene.mask)
    with pytest.raises(hi.InputError, match="depth is a bytes"):
        hi.Observation(bytes(3), mask, scene.camera)


def test_cameras_are_keys_and_name_a_wrong_size(scene):
    camera = scene.camera
    same = hi.Camera.from_K(camera.K, (camera.width, camera.height))
    assert {camera: 1}[same] == 1
    with pytest.raises(hi.InputError, match=r"size is \(48, 64, 3\), expected \(width, height\)"):
        hi.Camera.from_K(camera.K, (48, 64, 3))


def test_lengths_in_millimeters_and_transposed_poses_are_named(scene):
    with pytest.raises(hi.InputError, match="delta is 15, expected meters"):
        hi.vsd(scene.model, scene.observation, scene.true, scene.true, delta=15)
    with pytest.raises(hi.InputError, match="occlusion_tolerance is 10, expected meters"):
        hi.mve(scene.model, scene.observation, scene.true, occlusion_tolerance=10)
    with pytest.raises(hi.InputError, match=r"it may be transposed, pass T_co\.T"):
        hi.Pipeline().refine(scene.model, scene.observation, scene.true.T)


def test_modules_of_the_package_are_imported_at_their_first_use():
    code = "import hybrid_icp as hi; print(hi.bop.__name__); hi.unknown"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.stdout == "hybrid_icp.bop\n"
    assert "module 'hybrid_icp' has no attribute 'unknown'" in run.stderr


def test_pictures_of_pil_and_other_types_of_arrays_are_read(scene):
    pil = pytest.importorskip("PIL.Image")
    depth = np.round(scene.depth * 1000).astype(np.uint16)
    masks = [scene.mask.astype(int), scene.mask.astype(np.int32) * 255, pil.fromarray(scene.mask)]
    images = [depth.astype(np.int32), depth.astype(">u2"), pil.fromarray(depth)]
    expected = hi.Observation(depth, scene.mask, scene.camera, scale=0.001)
    for image, mask in zip(images, masks):
        read = hi.Observation(image, mask, scene.camera, scale=0.001)
        assert np.array_equal(read.depth, expected.depth)
        assert np.array_equal(read.mask, scene.mask)
    half = scene.depth.astype(np.float16)
    assert np.array_equal(hi.DepthImage(half).to_numpy(), half.astype(np.float32))
    for mask in (scene.mask.astype(int) * 3, scene.mask.astype(int) + 254):
        with pytest.raises(hi.InputError, match="mask is an array of int64 .* 0 and 1, or 0 and 255"):
            hi.Observation(scene.depth, mask, scene.camera)


def test_sequences_and_scenes_are_read(scene):
    size = np.array([320, 240])
    for pair in (size, size.tolist()):
        assert hi.Camera.from_K(scene.camera.K, pair) == scene.camera
    axes = np.array([[[0, 0, 1], [0.02, -0.01, 0]]])
    for symmetry_axes in (axes, axes.tolist(), [tuple(axes[0])]):
        model = hi.Model(scene.model.vertices, scene.model.faces, symmetry_axes=symmetry_axes)
        assert np.allclose(model.__getnewargs_ex__()[1]["symmetry_axes"], axes)
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(scene.model.vertices, scene.model.faces, process=False)
    model = hi.Model.from_trimesh(trimesh.Scene([mesh, mesh]), unit="m")
    assert len(model.faces) == 2 * len(scene.model.faces)
