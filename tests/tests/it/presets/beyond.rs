//! Contracts of the presets that go beyond the paper.
//!
//! - `local` never raises the score of imperfect masks.
//! - `search` and `auto` leave the pose of `local` only for one that they score better.
//! - A bounded search stays in its bound, wherever the origin of the mesh is.
//! - A search finds the object, or an equivalent pose.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::time::Duration;

use hicp_sim::{Household, perturb, rng};
use hicp_tests::{Scene, perturbed_scene, scene};
use hybrid_icp::core::{
    Isometry3, Model, ModelConfig, Observation, Point3, Problem, TriMesh, UnitQuaternion, Vector3,
    se3,
};
use hybrid_icp::icp::{
    Bound, HypothesisSearch, Rotations, SearchOptions, Session, Stage, Start, Termination, Verdict,
    Workspace,
};
use hybrid_icp::pipeline::PipelineFile;
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MeanVsd, ModelPoints, SampledMve, Score, add, mssd};
use hybrid_icp::{Preset, Refinement, Refiner, Warning, presets};
use proptest::prelude::*;

/// Returns the MVE that the presets decide by.
fn judged(scene: &Scene, observation: &Observation, pose: &Isometry3<f64>) -> f64 {
    let problem = Problem::new(&scene.model, observation);
    let mut workspace = Workspace::new(Rasterizer::default());
    MeanVsd::imperfect_mask().score(&mut workspace.context(&problem), pose)
}

/// Returns the true pose rotated by 180° around an axis of the object frame through the center.
fn flipped(scene: &Scene, axis: Vector3<f64>) -> Isometry3<f64> {
    let Point3 { coords: center } = scene.model.center();
    let turn = UnitQuaternion::new(axis * PI);
    scene.truth * Isometry3::from_parts((center - turn * center).into(), turn)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Checks `local` and the presets built on it, whatever the start, the image and the noise.
    #[test]
    fn the_score_is_never_raised(
        object in 0..Household::ALL.len(),
        seed in 0_u64..1000,
        noise in 0.0..4.0_f64,
        meters in 0.0..0.15_f64,
        angle in 0.0..PI,
    ) {
        let (scene, init) = perturbed_scene(Household::ALL[object], noise, &mut rng(seed), (meters, angle));
        // A bar hides a part of the object in half of the scenes. In a quarter, the mask includes
        // it.
        let observation = match seed % 4 {
            0 => scene.behind_a_bar(0.3, 0.05, false),
            1 => scene.behind_a_bar(0.3, 0.05, true),
            _ => scene.observe_again(),
        };
        let refine = |preset: Preset| {
            Refiner::preset(preset).refine(&scene.model, &observation, &init)
        };
        let local = refine(Preset::Local);
        let judged = |pose: &Isometry3<f64>| judged(&scene, &observation, pose);
        let before = judged(&local.outcome.camera_from_object);
        prop_assert!(before <= judged(&init), "{local:?}");
        for (preset, gain) in [(Preset::Local, 0.0), (Preset::Search, 0.02), (Preset::Auto, 0.02)] {
            let refined = refine(preset);
            let pose = refined.outcome.camera_from_object;
            if pose != local.outcome.camera_from_object {
                prop_assert!(judged(&pose) < before - gain, "{preset}: {refined:?}");
            }
            let kept = matches!(refined.outcome.verdict, Verdict::KeptInitial(_));
            prop_assert_eq!(pose == init, kept);
        }
    }

    /// The bound applies to the local stage of the search and to its hypotheses.
    #[test]
    fn a_bounded_search_stays_in_its_bound(
        object in 0..Household::ALL.len(),
        seed in 0_u64..1000,
        meters in 0.0..0.1_f64,
        angle in 0.0..PI,
        translation_meters in 0.001..0.1_f64,
        rotation_degrees in 1.0..180.0_f64,
        rotations in prop_oneof![Just(Rotations::Even), Just(Rotations::ViewAxis), Just(Rotations::Symmetry)],
    ) {
        let (scene, init) = perturbed_scene(Household::ALL[object], 0.5, &mut rng(seed), (meters, angle));
        let options = SearchOptions {
            bound: Some(Bound { translation_meters, rotation_degrees }),
            hypotheses: 64,
            refined: 3,
            rotations,
            ..SearchOptions::default()
        };
        let mut refiner = Refiner::new(presets::search_with(options));
        let refined = refiner.refine(&scene.model, &scene.observation, &init);
        let pose = refined.outcome.camera_from_object;
        let center = scene.model.center();
        let (moved, (turned, _)) = (pose * center - init * center, se3::pose_distance(&pose, &init));
        prop_assert!(moved.norm() <= translation_meters && turned.to_degrees() <= rotation_degrees);
    }
}

/// A rotation of an object moves an origin far from it by much more than a bound allows.
#[test]
fn a_bounded_search_does_not_depend_on_the_origin_of_the_mesh() {
    let scene = scene(Household::Pan, 0.0, &mut rng(0));
    let turn = UnitQuaternion::new(Vector3::new(0.44, -0.53, 0.55));
    let init = Isometry3::translation(0.008, -0.005, 0.01)
        * scene.truth
        * Isometry3::rotation_wrt_point(turn, scene.model.center());
    let options = SearchOptions {
        bound: Some(Bound {
            translation_meters: 0.05,
            rotation_degrees: 60.0,
        }),
        // All hypotheses come from the image and are moved into the bound.
        start: Start::Ignored,
        ..SearchOptions::default()
    };
    for meters in [0.0, 0.5, 10.0] {
        let shift = Isometry3::translation(meters, -0.7 * meters, 0.3 * meters);
        let mesh = scene.model.mesh();
        let vertices = mesh.vertices().iter();
        let vertices = vertices.map(|p| (shift * p.cast::<f64>()).cast()).collect();
        let model = Model::new(TriMesh::new(vertices, mesh.triangles().to_vec()).unwrap());
        let mut refiner = Refiner::new(presets::search_with(options));
        let found = refiner.refine(&model, &scene.observation, &(init * shift.inverse()));
        let pose = found.outcome.camera_from_object * shift;
        let (angle, distance) = se3::pose_distance(&pose, &scene.truth);
        assert!(angle < 1e-4 && distance < 1e-5, "{meters} m: {found:?}");
    }
}

/// `local` cannot correct a flipped object, but the score reveals it.
///
/// A flip counts only if the image shows it: from the side, a mug looks the same upside down.
#[test]
fn a_search_finds_the_pose_of_a_flipped_object() {
    let (mut visible, mut righted) = (0, 0);
    for (seed, object) in (0..).zip([Household::Mug, Household::Car, Household::Teapot]) {
        let scene = scene(object, 0.3, &mut rng(seed));
        let refine = |preset: Preset, init: &Isometry3<f64>| {
            Refiner::preset(preset).refine(&scene.model, &scene.observation, init)
        };
        let truth = refine(Preset::Local, &scene.truth).mve_initial;
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let init = flipped(&scene, axis);
            let local = refine(Preset::Local, &init).mve;
            if local <= 0.05 {
                continue;
            }
            visible += 1;
            let found = refine(Preset::Search, &init);
            assert!(
                found.mve < truth + 0.02,
                "{object:?} {axis:?}: {local} {} {truth}",
                found.mve
            );
            let pose = found.outcome.camera_from_object;
            let (angle, distance) = se3::pose_distance(&pose, &scene.truth);
            righted += usize::from(angle.to_degrees() < 2.0 && distance < 0.003);
        }
    }
    assert!(visible >= 4, "only {visible} of 9 flips are visible");
    assert!(
        righted + 1 >= visible,
        "{righted} of {visible} ended at the truth"
    );
}

/// The distance of two poses is that of the vertices if a model has no samples.
#[test]
fn far_poses_are_searched_without_samples() {
    let mut righted = 0;
    for (seed, object) in (0..).zip([Household::Mug, Household::Car, Household::Teapot]) {
        let scene = scene(object, 0.3, &mut rng(seed));
        let config = ModelConfig {
            samples: 0,
            ..ModelConfig::default()
        };
        let model = Model::with_config(scene.model.mesh().clone(), config);
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let found = Refiner::preset(Preset::Auto).refine(
                &model,
                &scene.observation,
                &flipped(&scene, axis),
            );
            let (angle, _) = se3::pose_distance(&found.outcome.camera_from_object, &scene.truth);
            let right = angle.to_degrees() < 2.0;
            righted += usize::from(right);
            assert!(
                right || found.confidence < 0.95,
                "{object:?} {axis:?}: {found:?}"
            );
        }
    }
    assert!(righted >= 7, "{righted} of 9 ended at the truth");
}

/// No image shows the rotation of a body of revolution around its axis, and the error ignores it.
#[test]
fn a_symmetric_object_is_found_up_to_its_symmetry() {
    let scene = scene(Household::Bottle, 0.3, &mut rng(4));
    let samples: Vec<_> = scene.model.samples().iter().map(|s| s.point).collect();
    let symmetries = scene.model.symmetries().motions();
    for axis in [Vector3::x(), Vector3::y()] {
        let init = flipped(&scene, axis);
        let refined =
            Refiner::preset(Preset::Search).refine(&scene.model, &scene.observation, &init);
        let pose = refined.outcome.camera_from_object;
        let error = mssd(&pose, &scene.truth, &samples, &symmetries);
        assert!(error < 0.002, "{axis:?}: {error}");
    }
}

/// A symmetric object has several true poses, and a search may return any of them.
///
/// MSSD over the declared symmetries is small at each, and ADD at only one. ADI over sampled points
/// does not work here: the symmetry maps samples between samples, which are millimeters apart. A
/// bounded search stays in its bound, and returns no equivalent pose outside it.
#[test]
fn a_search_finds_any_equivalent_pose_inside_its_bound() {
    let mut elsewhere = BTreeMap::new();
    for (object, seed) in [
        (Household::Carton, 0),
        (Household::Carton, 1),
        (Household::Pot, 1),
        (Household::Pot, 3),
        (Household::Headphones, 0),
    ] {
        let scene = scene(object, 0.3, &mut rng(seed));
        let points: Vec<_> = scene.model.samples().iter().map(|s| s.point).collect();
        let symmetries = scene.model.symmetries().motions();
        for axis in [Vector3::new(1.0, 1.0, 0.0), Vector3::new(0.0, 1.0, 1.0)] {
            let init = flipped(&scene, axis.normalize());
            let refine = |preset: Preset| {
                Refiner::preset(preset).refine(&scene.model, &scene.observation, &init)
            };
            let local = refine(Preset::Local);
            for preset in [Preset::Search, Preset::Auto] {
                let found = refine(preset);
                let pose = found.outcome.camera_from_object;
                if pose == local.outcome.camera_from_object {
                    continue;
                }
                let name = format!("{preset}, {object:?} {seed}, {axis:?}: {found:?}");
                let error = mssd(&pose, &scene.truth, &points, &symmetries);
                assert!(error < 0.002, "{name}: {error}");
                let far = add(&pose, &scene.truth, &points) > 0.02;
                *elsewhere.entry(preset.name()).or_insert(0) += usize::from(far);

                let turned = |pose| se3::pose_distance(pose, &init).0.to_degrees();
                let limit = 0.5 * turned(&pose);
                let mut file = PipelineFile::parse(preset.toml(), preset.name()).unwrap();
                file.set(&format!("max_rotation_degrees={limit}")).unwrap();
                let mut bounded = Refiner::boxed(file.build().unwrap());
                let kept = bounded.refine(&scene.model, &scene.observation, &init);
                assert!(turned(&kept.outcome.camera_from_object) <= limit, "{name}");
            }
        }
    }
    assert!(
        elsewhere["search"] >= 2 && elsewhere["auto"] >= 2,
        "{elsewhere:?}"
    );
}

/// A search that ignores its initial pose finds the object from the image alone.
#[test]
fn a_search_without_an_initial_pose_finds_the_object() {
    for (seed, object) in (0..).zip([Household::Iron, Household::Car, Household::Bracket]) {
        let scene = scene(object, 0.3, &mut rng(seed));
        let options = SearchOptions {
            start: Start::Ignored,
            ..SearchOptions::default()
        };
        let found = |init: &Isometry3<f64>| {
            let mut refiner = Refiner::new(presets::search_with(options));
            let refined = refiner.refine(&scene.model, &scene.observation, init);
            assert_eq!(refined.outcome.verdict, Verdict::Refined, "{object:?}");
            refined.outcome.camera_from_object
        };
        let pose = found(&Isometry3::identity());
        assert_eq!(pose, found(&Isometry3::translation(0.0, 0.0, -9.0)));
        let points: Vec<_> = scene.model.samples().iter().map(|s| s.point).collect();
        let error = mssd(
            &pose,
            &scene.truth,
            &points,
            &scene.model.symmetries().motions(),
        );
        assert!(error < 0.005, "{object:?}: {error}");
    }
}

/// A body of revolution has many poses that look the same, and only declared symmetries make them
/// equivalent.
#[test]
fn poses_that_look_the_same_are_ambiguous_unless_declared() {
    let scene = scene(Household::Plate, 0.3, &mut rng(5));
    let undeclared = Model::new(scene.model.mesh().clone());
    let init = perturb(&mut rng(6), &scene.truth, 0.004, 0.07);
    let listed = |refiner: &Refiner, refined: &Refinement, model: &Model| {
        assert_eq!(refined.runner_up, refiner.alternatives().first().copied());
        let pose = &refined.outcome.camera_from_object;
        for other in refiner.alternatives() {
            let (angle, _) = se3::pose_distance(&other.camera_from_object, pose);
            assert!(
                (angle.to_degrees() - other.rotation_degrees).abs() < 1e-6,
                "{other:?}"
            );
            assert!(other.mssd_meters > 0.1 * model.diameter());
            assert!(other.gap > -0.02 && other.score.is_finite());
        }
    };
    let ambiguous = |preset: Preset, model: &Model| {
        let mut refiner = Refiner::preset(preset);
        // A search in a search only refines.
        let refined = refiner.estimate(model, &scene.observation);
        let by_local = Refiner::preset(Preset::Local).estimate(model, &scene.observation);
        assert_eq!(refined, by_local);
        listed(&refiner, &refined, model);
        let refined = refiner.refine(model, &scene.observation, &init);
        listed(&refiner, &refined, model);
        let warned = |w: &Warning| matches!(w, Warning::Ambiguous { gap, .. } if *gap < 0.01);
        refined.warnings().iter().any(warned)
    };
    for preset in [Preset::Search, Preset::Auto] {
        assert!(ambiguous(preset, &undeclared), "{preset}");
        assert!(!ambiguous(preset, &scene.model), "{preset}");
    }
    assert!(!ambiguous(Preset::Local, &undeclared));
}

/// The handle changes the score by less than the gain that a search requires.
#[test]
fn a_rotated_mug_is_rotated_back_if_the_image_shows_its_handle() {
    for (seed, degrees) in [(7, -55.0), (12, 25.0), (31, -55.0), (37, -35.0)] {
        let scene = scene(Household::Mug, 0.5, &mut rng(seed));
        let start = scene.truth * Isometry3::rotation(Vector3::z() * f64::to_radians(degrees));
        let error = |preset| {
            let found = Refiner::preset(preset).refine(&scene.model, &scene.observation, &start);
            let pose = &found.outcome.camera_from_object;
            ModelPoints::new(&scene.model).mssd(pose, &scene.truth) / scene.model.diameter()
        };
        let errors = [error(Preset::Local), error(Preset::Auto)];
        assert!(errors[0] > 0.2 && errors[1] < 0.02, "{seed}: {errors:?}");
    }
}

/// Of the poses that look the same, a search returns the one nearest to the initial rotation.
#[test]
fn a_search_keeps_the_rotation_that_the_image_does_not_show() {
    for seed in [1, 3, 4, 5] {
        let scene = scene(Household::Can, 0.3, &mut rng(seed));
        let undeclared = Model::new(scene.model.mesh().clone());
        // Beside the object, from where `local` does not find it.
        let init = Isometry3::translation(0.5, 0.0, 0.0) * scene.truth;
        let error = |preset| {
            let found = Refiner::preset(preset).refine(&undeclared, &scene.observation, &init);
            se3::pose_distance(&found.outcome.camera_from_object, &scene.truth)
        };
        assert!(error(Preset::Local).1 > 0.03);
        let (angle, distance) = error(Preset::Search);
        assert!(angle.to_degrees() < 20.0, "{seed}: {angle}");
        assert!(distance < 1e-3, "{seed}: {distance}");
    }
}

#[test]
fn a_flat_side_is_shifted_to_its_silhouette() {
    let scene = scene(Household::Carton, 0.0, &mut rng(7));
    let init = perturb(&mut rng(7), &scene.truth, 0.003, 0.05);
    let found = Refiner::preset(Preset::Local).refine(&scene.model, &scene.observation, &init);
    let (_, distance) = se3::pose_distance(&found.outcome.camera_from_object, &scene.truth);
    assert!(distance < 1e-3, "{distance}");
}

/// Without a near initial pose, each pose that looks the same may be the right one. With one, the
/// others are less likely, but still possible.
#[test]
fn poses_that_look_the_same_lower_the_confidence_unless_declared() {
    let scene = scene(Household::Plate, 0.3, &mut rng(5));
    let undeclared = Model::new(scene.model.mesh().clone());
    let init = perturb(&mut rng(6), &scene.truth, 0.004, 0.07);
    let mut refiner = Refiner::preset(Preset::Local);
    let found = [&undeclared, &scene.model].map(|m| refiner.estimate(m, &scene.observation));
    assert!(found[0].look_alikes > 0.5, "{}", found[0].look_alikes);
    // Upside down it is not right, but nearly.
    assert!(found[1].look_alikes < 1e-3, "{}", found[1].look_alikes);
    let [turned, equivalent] = found.map(|refined| refined.confidence);
    assert!(turned < 0.7 && equivalent > 0.9, "{turned} {equivalent}");
    let near = [&undeclared, &scene.model].map(|m| refiner.refine(m, &scene.observation, &init));
    assert!(near[0].look_alikes > 0.5, "{}", near[0].look_alikes);
    let [near, declared] = near.map(|refined| refined.confidence);
    assert!(turned < near && near < declared, "{near} {declared}");
}

/// Without any time, the search returns the local pose and reports the deadline.
#[test]
fn a_search_out_of_time_returns_the_local_pose() {
    let scene = scene(Household::Mug, 0.3, &mut rng(0));
    let init = flipped(&scene, Vector3::z());
    let options = SearchOptions {
        time_limit: Some(Duration::ZERO),
        ..SearchOptions::default()
    };
    let mut refiner = Refiner::new(presets::search_with(options));
    let refined = refiner.refine(&scene.model, &scene.observation, &init);
    let local = Refiner::preset(Preset::Local).refine(&scene.model, &scene.observation, &init);
    assert!(local.mve > options.threshold, "nothing to search for");
    assert_eq!(refined.outcome.termination, Termination::Deadline);
    assert_eq!(
        refined.outcome.camera_from_object,
        local.outcome.camera_from_object
    );
}

/// The limit of the refiner's stage is that of an estimate. Without any time, it refines one pose.
#[test]
fn an_estimate_has_the_time_limit_of_its_stage() {
    let scene = scene(Household::Mug, 0.3, &mut rng(0));
    let estimate = |time_limit| {
        let options = SearchOptions {
            time_limit,
            ..SearchOptions::default()
        };
        let mut refiner = Refiner::new(presets::by_color(presets::search_with(options)));
        refiner.estimate(&scene.model, &scene.observation)
    };
    let none = estimate(Some(Duration::ZERO));
    assert_eq!(none.outcome.verdict, Verdict::Refined);
    assert_eq!(none.outcome.termination, Termination::Deadline);
    assert!(none.mve < 0.8, "{}", none.mve);
    let (most, least) = (estimate(Some(Duration::MAX)), estimate(None));
    assert_eq!(most, least);
    assert!(most.mve < 0.1, "{}", most.mve);
}

/// If no hypothesis can win by the gain, none is ranked.
#[test]
fn a_search_without_a_possible_gain_is_not_started() {
    let scene = scene(Household::Mug, 0.3, &mut rng(0));
    let init = flipped(&scene, Vector3::z());
    let problem = scene.problem();
    let mut workspace = Workspace::new(Rasterizer::default());
    let mut ranked = |gain: f64| {
        let mut search = presets::search_with(SearchOptions {
            near_gain: gain,
            far_gain: gain,
            ..SearchOptions::default()
        });
        search.run(&problem, &init, &mut Session::new(&mut workspace, &mut ()));
        search.ranked().count()
    };
    assert!(ranked(0.04) > 0);
    assert_eq!(ranked(2.0), 0);
}

/// Rotations outside of the bound also cost time. Symmetries that an object does not have cost
/// none.
#[test]
fn a_search_without_hypotheses_ends_in_time() {
    let scene = scene(Household::Mug, 0.3, &mut rng(0));
    let init = flipped(&scene, Vector3::z());
    assert!(scene.model.symmetries().is_empty());
    for (rotations, bound, time_limit) in [
        (Rotations::Symmetry, None, None),
        (
            Rotations::ViewAxis,
            Some(Bound {
                translation_meters: 0.1,
                rotation_degrees: 1e-9,
            }),
            Some(Duration::from_millis(100)),
        ),
    ] {
        let options = SearchOptions {
            rotations,
            bound,
            time_limit,
            hypotheses: usize::MAX,
            ..SearchOptions::default()
        };
        let mut refiner = Refiner::new(presets::search_with(options));
        let refined = refiner.refine(&scene.model, &scene.observation, &init);
        assert!(
            refined
                .outcome
                .camera_from_object
                .translation
                .vector
                .iter()
                .all(|x| x.is_finite())
        );
        let out_of_time = refined.outcome.termination == Termination::Deadline;
        assert_eq!(out_of_time, time_limit.is_some(), "{rotations:?}");
    }
}

/// If the threshold is never exceeded and nothing else is refined, a search equals its local stage.
#[test]
fn a_search_without_refined_hypotheses_is_its_local_stage() {
    let scene = scene(Household::Mug, 0.3, &mut rng(0));
    let init = flipped(&scene, Vector3::z());
    let options = SearchOptions {
        threshold: 1.0,
        far_threshold: 1.0,
        refined: 0,
        ..SearchOptions::default()
    };
    let mut refiner = Refiner::new(presets::search_with(options));
    let refined = refiner.refine(&scene.model, &scene.observation, &init);
    let local = Refiner::preset(Preset::Local).refine(&scene.model, &scene.observation, &init);
    assert_eq!(refined, local);
    let search = HypothesisSearch::new(
        presets::local(),
        (presets::hybrid(), presets::hybrid(), presets::hybrid()),
        (
            SampledMve::new(200, 400),
            MeanVsd::default(),
            MeanVsd::default(),
        ),
        options,
    );
    let composed = Refiner::new(search).refine(&scene.model, &scene.observation, &init);
    assert_eq!(composed, local);
}
