"""Tests plots, recordings and adapters, with stand-ins where another library is large."""

import numpy as np
import pytest

import hybrid_icp as hi
from conftest import write_png
from hybrid_icp import adapters


NAMES = ["/object", "/observed", "/pairs", "/mean_loss"]


def test_plots_show_a_refinement(scene):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from hybrid_icp import plot

    events = []
    result = hi.Pipeline("local").refine(
        scene.model, scene.observation, scene.rough, events.append
    )
    ax = plot.convergence(events)
    assert len(ax.lines[0].get_xdata()) == len(events) > 3
    ax = plot.overlay(result, scene.observation)
    assert ax.get_images()[0].get_array().shape == (240, 320, 3)
    ax = plot.correspondences(scene.observation, result.T_co, scene.model, count=50)
    observed, model = ax.lines[-2:]
    assert 40 <= len(observed.get_xdata()) <= 120
    assert np.allclose(observed.get_ydata(), model.get_ydata(), atol=1e-3)


def test_a_recording_has_every_iteration(scene, tmp_path):
    rr = pytest.importorskip("rerun")
    from hybrid_icp import rerun

    path = tmp_path / "refinement.rrd"
    rr.init("test")
    rr.save(str(path))
    result = rerun.refine(hi.Pipeline("local"), scene.model, scene.observation, scene.rough)
    rr.disconnect()
    direct = hi.Pipeline("local").refine(scene.model, scene.observation, scene.rough)
    assert result.to_dict() == direct.to_dict()
    chunks = list(pytest.importorskip("rerun.chunk").RrdReader(str(path)).stream().to_chunks())
    rows = {name: sum(c.num_rows for c in chunks if c.entity_path == name) for name in NAMES}
    iterations = rows["/mean_loss"]
    # The mesh is logged once without a time, and the pose once more at the end.
    assert iterations > 3 and rows["/object"] == iterations + 2
    assert rows["/pairs"] == iterations + 1 and rows["/observed"] == 1


class Column(dict):
    """A column of a filtered table, whose rows keep their old numbers, as in pandas."""

    def __init__(self, values):
        super().__init__({10 + row: value for row, value in enumerate(values)})

    def __iter__(self):
        return iter(self.values())


class Estimates:
    """Estimates in the shape of HappyPose's."""

    def __init__(self, labels, images, poses):
        self.infos = {"label": Column(labels), "batch_im_id": Column(images)}
        self.poses = poses

    def clone(self):
        return Estimates(*self.infos.values(), self.poses.copy())


def test_estimates_of_happypose_are_refined(scene):
    rough = Estimates(["bracket"] * 2, [0, 0], np.stack([scene.rough, scene.true]))
    refiner = adapters.DepthRefiner({"bracket": scene.model})
    images = {"depth": scene.depth[None], "K": scene.camera.K[None]}
    for masks in (None, [scene.mask] * 2):
        refined, extra = refiner.refine_poses(rough, **images, masks=masks)
        assert np.array_equal(rough.poses[0], scene.rough), "the input is unchanged"
        for pose, result in zip(refined.poses, extra["results"]):
            assert hi.add(pose, scene.true, scene.model) < 0.002
            assert np.array_equal(pose, result.T_co)
    empty = Estimates([], [], np.zeros((0, 4, 4)))
    assert refiner.refine_poses(empty, **images)[1] == {"results": []}


def test_a_folder_of_foundationpose_is_read(scene, tmp_path):
    for name in ("depth", "masks", "ob_in_cam"):
        (tmp_path / name).mkdir()
    units = (scene.depth * 1000).round().astype(np.uint16)
    for frame in ("000000", "000001"):
        write_png(tmp_path / "depth" / f"{frame}.png", units)
        np.savetxt(tmp_path / "ob_in_cam" / f"{frame}.txt", scene.rough)
    write_png(tmp_path / "masks" / "000000.png", scene.mask.astype(np.uint8) * 255)
    np.savetxt(tmp_path / "cam_K.txt", scene.camera.K)
    folder = adapters.FoundationPoseFolder(tmp_path)
    assert len(folder) == 2 and np.allclose(folder.pose(1), scene.rough)
    first, second = folder.observation(0), folder.observation(1)
    assert np.array_equal(first.mask, scene.mask) and second.mask.all()
    result = hi.Pipeline().refine(scene.model, first, folder.pose(0))
    assert hi.add(result.T_co, scene.true, scene.model) < 0.002
