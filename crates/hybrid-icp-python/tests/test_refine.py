"""Tests refinement: results, order, threads, observers and interruption."""

import dataclasses
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


def test_the_default_pipeline_is_auto(scene):
    default, auto = hi.Pipeline(), hi.Pipeline.preset("auto")
    assert (default.name, default.toml) == ("auto", auto.toml)
    results = [p.refine(scene.model, scene.observation, scene.rough) for p in (default, auto)]
    assert results[0].to_dict() == results[1].to_dict()
    assert hi.Pipeline("hybrid", overrides=["times=1"]).name == "hybrid times=1"


def test_refinement_reduces_the_error_of_a_pose(scene):
    result = hi.Pipeline.preset("hybrid").refine(scene.model, scene.observation, scene.rough)
    assert result.outcome == "refined" and result.refined
    before, after = (hi.add(T_co, scene.true, scene.model) for T_co in (scene.rough, result.T_co))
    assert before > 0.01 and after < 0.0001
    assert result.mve < 0.01 and result.mve_initial > 0.3
    assert 0.95 <= result.confidence <= 1.0
    assert result.expected_error_meters < 0.01 and result.expected_error_degrees < 10
    assert result.look_alikes < 1e-3
    assert result.T_co.shape == (4, 4) and result.T_co.dtype == np.float64
    assert result.mve == hi.mve(scene.model, scene.observation, result.T_co)
    assert result.warnings == []


def test_errors_of_5_cm_become_less_than_half_a_millimeter_in_a_noisy_image(scene):
    random = np.random.default_rng(3)
    # Every pixel has 1 mm of noise, and 10 % of the pixels are missing.
    noisy = (scene.depth + random.normal(0, 0.001, scene.depth.shape)).astype(np.float32)
    noisy[random.random(noisy.shape) < 0.1] = 0
    observation = hi.Observation(noisy, scene.mask, scene.camera)
    rough = many(scene, 12)
    results = hi.Pipeline.preset("hybrid").refine_batch(scene.model, observation, rough)
    before = [hi.add(T_co, scene.true, scene.model) for T_co in rough]
    after = [hi.add(result.T_co, scene.true, scene.model) for result in results]
    assert max(before) > 0.04 and np.median(before) > 0.02
    assert max(after) < 0.0005


def test_the_covariance_is_the_inverse_of_the_information_up_to_the_noise(scene):
    pipeline = hi.Pipeline.preset("projective-point-to-plane")
    result = pipeline.refine(scene.model, scene.observation, scene.rough)
    assert result.information.shape == (6, 6)
    product = result.information @ result.covariance
    assert np.allclose(product, np.eye(6) * product[0, 0], atol=1e-6 * abs(product[0, 0]))


def test_a_pose_that_cannot_be_refined_is_returned_unchanged(scene):
    empty = hi.Observation(scene.depth, np.zeros_like(scene.mask), scene.camera)
    rough = scene.rough.copy()
    rough[0, 0] += 1e-9  # Orthogonal only within the tolerance.
    result = hi.Pipeline.preset("hybrid").refine(scene.model, empty, rough)
    assert (result.outcome, result.termination) == ("kept_initial", "no_pairs")
    assert result.warnings == ["MVE 1.000: the pose does not explain the image, do not trust it"]
    assert np.array_equal(result.T_co, rough)
    assert result.covariance is None and result.mean_loss is None and result.n_pairs == 0


def test_the_dictionary_has_every_attribute_and_json_accepts_it(scene):
    result = hi.Pipeline.preset("hybrid").refine(scene.model, scene.observation, scene.rough)
    known = json.loads(json.dumps(result.to_dict()))
    attributes = {field.name for field in dataclasses.fields(hi.Result)}
    assert set(known) == attributes - {"model"}
    assert np.array_equal(known["T_co"], result.T_co)
    evidence = known["evidence"]
    assert evidence["agrees"] > 0.9 and evidence["seen_through"] + evidence["inside"] < 0.1
    assert known["stages"][0]["regime"] in ("aligned", "misaligned")
    assert repr(result).startswith("Result(refined, confidence ")


def test_other_poses_of_a_search_come_with_their_scores(scene):
    pipeline = hi.Pipeline("search", overrides={"start": "ignored", "good_enough": 0})
    result = pipeline.refine(scene.model, scene.observation, scene.rough)
    assert result.alternatives
    scores = [other.score for other in result.alternatives]
    assert scores == sorted(scores)
    for other in result.alternatives:
        assert other.T_co.shape == (4, 4) and other.gap <= other.score
        assert other.mssd > 0 and other.rotation_degrees > 0
        assert repr(other).startswith("Alternative(") and not other.T_co.flags.writeable
    [again] = pipeline.refine_batch(scene.model, scene.observation, [scene.rough])
    assert again.to_dict()["alternatives"] == result.to_dict()["alternatives"]
    local = hi.Pipeline.preset("local").refine(scene.model, scene.observation, scene.rough)
    assert local.alternatives == []


def test_an_object_is_found_without_an_initial_pose(scene):
    result = hi.Pipeline().estimate(scene.model, scene.observation)
    assert hi.add(result.T_co, scene.true, scene.model) < 0.001
    assert result.refined and result.mve < 0.05 and result.mve_initial == result.mve
    assert result.warnings == [] and result.stages
    again = hi.Pipeline().estimate(scene.model, scene.observation)
    assert again.to_dict() == result.to_dict()


def test_nothing_is_found_in_an_empty_mask(scene):
    empty = hi.Observation(scene.depth, np.zeros_like(scene.mask), scene.camera)
    result = hi.Pipeline().estimate(scene.model, empty)
    assert (result.outcome, result.termination) == ("kept_initial", "no_pairs")
    assert np.array_equal(result.T_co, np.eye(4)) and result.mve == 1.0
    assert result.warnings == ["MVE 1.000: the pose does not explain the image, do not trust it"]


@pytest.mark.parametrize("threads", [1, 2, 5, None])
def test_a_batch_has_the_bits_of_single_calls_in_order(scene, threads):
    poses = many(scene, 12)
    pipeline = hi.Pipeline.preset("hybrid")
    batch = pipeline.refine_batch(scene.model, scene.observation, poses, threads=threads)
    single = [pipeline.refine(scene.model, scene.observation, pose) for pose in poses]
    assert [r.to_dict() for r in batch] == [r.to_dict() for r in single]


def test_an_empty_batch_is_an_empty_list(scene):
    pipeline, poses = hi.Pipeline.preset("hybrid"), np.zeros((0, 4, 4))
    assert pipeline.refine_batch(scene.model, scene.observation, poses) == []


def test_the_presets_match_the_program_and_the_documentation(program):
    command = [program, "pipelines"]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    names = hi.Pipeline.presets()
    assert names[0] == "hybrid" and {"hybrid-visible", "local", "search", "auto"} < set(names)
    documented = (ROOT / "docs" / "python.md").read_text()
    for name in names:
        assert re.search(rf"^\W*{name}\b", listed, re.MULTILINE), name
        assert hi.Pipeline.preset(name).name == name
    for name in ("hybrid", "hybrid-visible", "local", "search", "auto"):
        assert f"`{name}`" in documented, name


def test_names_texts_files_and_pickles_give_the_same_pipeline(scene, tmp_path):
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
        self.iterations, self.regimes, self.decisions, self.stages = [], [], [], []

    def on_iteration(self, event):
        self.iterations.append(event)

    def on_regime(self, event):
        self.regimes.append(event)

    def on_decision(self, event):
        self.decisions.append(event)

    def on_stage_end(self, event):
        self.stages.append(event)


def test_an_observer_receives_every_event_and_changes_nothing(scene):
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


def test_an_observer_receives_the_decisions_of_guards(scene):
    recorder = Recorder()
    hi.Pipeline.preset("local").refine(scene.model, scene.observation, scene.rough, recorder)
    first = recorder.decisions[0]
    assert first.stage == "guard" and first.kept and first.score < first.best
    assert all(event.kept == (event.score < event.best) for event in recorder.decisions)
    assert np.allclose(first.T_co, recorder.stages[0].T_co)
    assert repr(first).startswith("DecisionEvent(guard keeps 0.")


def test_an_observer_stops_with_false_and_its_exceptions_are_raised(scene):
    pipeline = hi.Pipeline.preset("projective-point-to-plane")
    stopped = pipeline.refine(
        scene.model, scene.observation, scene.rough, lambda event: event.iteration < 1
    )
    assert (stopped.termination, stopped.iterations) == ("stopped", 2)

    def fail(event):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        pipeline.refine(scene.model, scene.observation, scene.rough, fail)
    with pytest.raises(hi.InputError, match="observer is an int, expected a callable"):
        pipeline.refine(scene.model, scene.observation, scene.rough, 3)


def test_control_c_ends_a_batch(tmp_path):
    program = tmp_path / "batch.py"
    program.write_text(
        textwrap.dedent(
            """
            import signal
            import numpy as np
            import hybrid_icp as hi
            # A background process may inherit a disabled SIGINT.
            signal.signal(signal.SIGINT, signal.default_int_handler)
            corners = [[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, .02], [-.1, .1, 0]]
            model = hi.Model(corners, [[0, 2, 1], [0, 3, 2]])
            camera = hi.Camera(600, 600, 319.5, 239.5, 640, 480)
            pose = np.eye(4); pose[2, 3] = 0.5
            depth = hi.render_depth(model, camera, pose)
            observation = hi.Observation(depth, depth > 0, camera)
            pose[2, 3] = 0.52
            print("ready", flush=True)
            try:
                poses = np.repeat(pose[None], 1_000_000, 0)
                hi.Pipeline.preset("nn-point-to-point").refine_batch(model, observation, poses)
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
            # One million refinements would take many minutes.
            assert process.communicate(timeout=60)[0] == "interrupted\n"
            assert process.returncode == 0
        finally:
            process.kill()


def test_a_pose_is_judged_as_it_is(scene):
    pipeline = hi.Pipeline()
    judged = pipeline.judge(scene.model, scene.observation, scene.true)
    assert np.allclose(judged.T_co, scene.true) and judged.outcome == "kept_initial"
    assert judged.mve == judged.mve_initial < 0.1 < 0.9 < judged.confidence
    rough = pipeline.judge(scene.model, scene.observation, scene.rough)
    assert rough.mve > judged.mve and rough.confidence < judged.confidence
