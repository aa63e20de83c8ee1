"""Refining: results, order, threads, observers, interruption."""

import json
import pickle
import re
import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import hybrid_icp as hi
from conftest import ROOT, many


def test_a_rough_pose_becomes_a_better_one(scene):
    result = hi.Pipeline.preset("hybrid").refine(scene.model, scene.observation, scene.rough)
    assert result.outcome == "refined" and result.refined
    before, after = (hi.add(T_co, scene.true, scene.model) for T_co in (scene.rough, result.T_co))
    assert before > 0.01 and after < 0.0001
    assert result.mve < 0.01 and result.mve_initial > 0.3
    assert result.T_co.shape == (4, 4) and result.T_co.dtype == np.float64
    assert result.mve == hi.mve(scene.model, scene.observation, result.T_co)
    assert result.warnings == []


def test_poses_five_centimetres_off_come_within_half_a_millimetre_in_a_noisy_image(scene):
    random = np.random.default_rng(3)
    # A millimetre of noise on every pixel, and a tenth of them missing.
    noisy = (scene.depth + random.normal(0, 0.001, scene.depth.shape)).astype(np.float32)
    noisy[random.random(noisy.shape) < 0.1] = 0
    observation = hi.Observation(noisy, scene.mask, scene.camera)
    rough = many(scene, 12)
    before = [hi.add(T_co, scene.true, scene.model) for T_co in rough]
    after = [hi.add(r.T_co, scene.true, scene.model) for r in hi.Pipeline.preset("hybrid").refine_batch(scene.model, observation, rough)]
    assert max(before) > 0.04 and np.median(before) > 0.02
    assert max(after) < 0.0005


def test_the_covariance_is_the_inverse_of_the_information_up_to_the_noise(scene):
    result = hi.Pipeline.preset("projective-point-to-plane").refine(scene.model, scene.observation, scene.rough)
    assert result.information.shape == (6, 6)
    product = result.information @ result.covariance
    assert np.allclose(product, np.eye(6) * product[0, 0], atol=1e-6 * abs(product[0, 0]))


def test_a_pose_that_cannot_be_refined_is_given_back_as_it_was(scene):
    empty = hi.Observation(scene.depth, np.zeros_like(scene.mask), scene.camera)
    rough = scene.rough.copy()
    rough[0, 0] += 1e-9  # Orthogonal to its digits only.
    result = hi.Pipeline.preset("hybrid").refine(scene.model, empty, rough)
    assert (result.outcome, result.termination) == ("kept_initial", "no_pairs")
    assert result.warnings == ["MVE 1.000: the pose does not explain the image, do not trust it"]
    assert np.array_equal(result.T_co, rough)
    assert result.covariance is None and result.mean_loss is None and result.n_pairs == 0


def test_everything_is_in_the_dictionary_and_json_takes_it(scene):
    result = hi.Pipeline.preset("hybrid").refine(scene.model, scene.observation, scene.rough)
    known = json.loads(json.dumps(result.to_dict()))
    attributes = {name for name in dir(hi.Result) if not name.startswith("_")} - {"to_dict", "refined"}
    assert set(known) == attributes
    assert np.array_equal(known["T_co"], result.T_co)
    assert known["stages"][0]["regime"] in ("aligned", "misaligned")
    assert repr(result).startswith("Result(refined, mve 0.")


@pytest.mark.parametrize("threads", [1, 2, 5, None])
def test_a_batch_has_the_bits_of_single_calls_in_order(scene, threads):
    poses = many(scene, 12)
    pipeline = hi.Pipeline.preset("hybrid")
    batch = pipeline.refine_batch(scene.model, scene.observation, poses, threads=threads)
    single = [pipeline.refine(scene.model, scene.observation, pose) for pose in poses]
    assert [r.to_dict() for r in batch] == [r.to_dict() for r in single]


def test_an_empty_batch_is_an_empty_list(scene):
    assert hi.Pipeline.preset("hybrid").refine_batch(scene.model, scene.observation, np.zeros((0, 4, 4))) == []


def test_the_presets_are_those_of_the_program_and_documented(program):
    listed = subprocess.run([program, "pipelines"], check=True, capture_output=True, text=True).stdout
    names = hi.Pipeline.presets()
    assert names[0] == "hybrid" and {"hybrid-visible", "local", "search", "auto"} < set(names)
    documented = (ROOT / "docs" / "python.md").read_text()
    for name in names:
        assert re.search(rf"^\W*{name}\b", listed, re.MULTILINE), name
        assert hi.Pipeline.preset(name).name == name
    for name in ("hybrid", "hybrid-visible", "local", "search", "auto"):
        assert f"`{name}`" in documented, name


def test_pipelines_come_from_names_texts_files_and_pickles(scene, tmp_path):
    preset = hi.Pipeline.preset("hybrid", overrides=["times=1"])
    file = tmp_path / "mine.toml"
    file.write_text(hi.Pipeline.preset("hybrid").toml)
    others = [
        hi.Pipeline.from_toml(file, overrides=["times=1"]),
        hi.Pipeline.from_toml(str(file), overrides=["times=1"]),
        hi.Pipeline.from_toml(file.read_text(), overrides=["times=1"]),
        pickle.loads(pickle.dumps(preset)),
    ]
    expected = preset.refine(scene.model, scene.observation, scene.rough).to_dict()
    for other in others:
        assert other.refine(scene.model, scene.observation, scene.rough).to_dict() == expected
    assert len(preset.refine(scene.model, scene.observation, scene.rough).stages) < len(
        hi.Pipeline.preset("hybrid").refine(scene.model, scene.observation, scene.rough).stages
    )


class Recorder:
    def __init__(self):
        self.iterations, self.regimes, self.stages = [], [], []

    def on_iteration(self, event):
        self.iterations.append(event)

    def on_regime(self, event):
        self.regimes.append(event)

    def on_stage_end(self, event):
        self.stages.append(event)


def test_an_observer_sees_every_event_and_changes_nothing(scene):
    pipeline, recorder, events = hi.Pipeline.preset("hybrid"), Recorder(), []
    plain = pipeline.refine(scene.model, scene.observation, scene.rough)
    observed = pipeline.refine(scene.model, scene.observation, scene.rough, recorder)
    pipeline.refine(scene.model, scene.observation, scene.rough, observer=events.append)
    assert observed.to_dict() == plain.to_dict()
    assert len(recorder.iterations) == len(events) == plain.iterations
    assert len(recorder.stages) == len(plain.stages)
    assert recorder.regimes[0].regime == plain.stages[0].regime
    first = recorder.iterations[0]
    assert np.allclose(first.T_co, scene.rough, atol=1e-12) and first.iteration == 0
    second = recorder.iterations[1]
    assert np.allclose(first.increment @ first.T_co, second.T_co, atol=1e-9)


def test_an_observer_stops_with_false_and_its_exceptions_are_raised(scene):
    pipeline = hi.Pipeline.preset("projective-point-to-plane")
    stopped = pipeline.refine(scene.model, scene.observation, scene.rough, lambda event: event.iteration < 1)
    assert (stopped.termination, stopped.iterations) == ("stopped", 2)

    def fail(event):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        pipeline.refine(scene.model, scene.observation, scene.rough, fail)
    with pytest.raises(hi.InputError, match="observer is a int, expected a callable"):
        pipeline.refine(scene.model, scene.observation, scene.rough, 3)


def test_control_c_ends_a_batch(tmp_path):
    program = tmp_path / "batch.py"
    program.write_text(
        textwrap.dedent(
            """
            import signal
            import numpy as np
            import hybrid_icp as hi
            # A parent in the background may have had it ignored.
            signal.signal(signal.SIGINT, signal.default_int_handler)
            model = hi.Model([[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, .02], [-.1, .1, 0]], [[0, 2, 1], [0, 3, 2]])
            camera = hi.Camera(600, 600, 319.5, 239.5, 640, 480)
            pose = np.eye(4); pose[2, 3] = 0.5
            depth = hi.render_depth(model, camera, pose)
            observation = hi.Observation(depth, depth > 0, camera)
            pose[2, 3] = 0.52
            print("ready", flush=True)
            try:
                hi.Pipeline.preset("nn-point-to-point").refine_batch(model, observation, np.repeat(pose[None], 1_000_000, 0))
            except KeyboardInterrupt:
                print("interrupted", flush=True)
            """
        )
    )
    with subprocess.Popen([sys.executable, program], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.5)
            process.send_signal(signal.SIGINT)
            # A million refinements take many minutes.
            assert process.communicate(timeout=60)[0] == "interrupted\n"
            assert process.returncode == 0
        finally:
            process.kill()
