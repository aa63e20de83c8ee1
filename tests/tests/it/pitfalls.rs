//! Tests of mistakes in other libraries that need several crates.
//!
//! `docs/pitfalls.md` lists all of these mistakes with their tests.

use std::ops::ControlFlow;

use hicp_sim::{Household, perturb, rng};
use hicp_tests::{Scene, camera, render, scene};
use hybrid_icp::association::{AllSamples, DataAssociation, Projective, VisibleSurface};
use hybrid_icp::core::Iteration;
use hybrid_icp::core::internal::pose_bits as bits;
use hybrid_icp::core::{
    Context, Correspondences, DepthImage, Isometry3, Mask, Observation, Pair, PinholeCamera,
    RigidTransform, Surfel, UnitVector3, Vector3, se3,
};
use hybrid_icp::icp::{
    Convergence, Icp, IterationEvent, IterationLimit, Observer, Quality, StageEvent, Verdict,
};
use hybrid_icp::metric::{
    GaussNewton, Generalized, LevenbergMarquardt, Minimize, PlaneToPoint, PointToPlane,
    PointToPoint, Symmetric,
};
use hybrid_icp::{BoxedStage, Preset, Refiner};

/// Without a pair there is nothing to measure. A perfect 0 or an identity pose would be false.
#[test]
fn without_pairs_there_is_no_quality_and_the_initial_pose_stays() {
    let scene = scene(Household::Mug, 0.0, &mut rng(31));
    let (width, height) = (camera().width(), camera().height());
    let nothing = vec![false; (width * height) as usize];
    let unseen = Scene {
        observation: Observation::new(
            scene.observation.depth().clone(),
            Mask::new(width, height, nothing).unwrap(),
            camera(),
        )
        .unwrap(),
        ..scene
    };
    let init = perturb(&mut rng(32), &unseen.truth, 0.01, 0.2);
    for preset in Preset::ALL {
        let outcome = unseen.run(&mut *preset.build(), &init, &mut ());
        assert_eq!(bits(&outcome.camera_from_object), bits(&init), "{preset}");
        assert!(
            matches!(outcome.verdict, Verdict::KeptInitial(_)),
            "{preset}"
        );
        assert_eq!(
            (outcome.evaluation, outcome.quality),
            (None, None),
            "{preset}"
        );
    }
    assert_eq!(
        Quality::of(
            &Iteration::default(),
            &Correspondences::new(),
            &mut PointToPlane
        ),
        None
    );
}

/// A few valid pixels give no normals, or fewer rows than unknowns.
///
/// The initial pose is kept and flagged. The result is not the identity.
#[test]
fn a_few_valid_pixels_keep_the_initial_pose_and_report_it() {
    let scene = scene(Household::Iron, 0.0, &mut rng(33));
    let init = perturb(&mut rng(34), &scene.truth, 0.005, 0.1);
    for n in 1..=3 {
        let mut left = n;
        let depth = scene.observation.depth();
        let pixels = depth.pixels().iter().map(|z| {
            let keep = *z > 0.0 && left > 0;
            left -= usize::from(keep);
            if keep { *z } else { 0.0 }
        });
        let depth =
            DepthImage::from_meters(depth.width(), depth.height(), pixels.collect()).unwrap();
        let mask = scene.observation.mask().clone();
        let observation = Observation::new(depth, mask, camera()).unwrap();
        assert_eq!(observation.n_measured(), n);
        for preset in Preset::ALL {
            let refined = Refiner::preset(preset).refine(&scene.model, &observation, &init);
            let pose = refined.outcome.camera_from_object;
            assert_eq!(bits(&pose), bits(&init), "{preset} {n}");
            assert!(
                matches!(refined.outcome.verdict, Verdict::KeptInitial(_)),
                "{preset} {n}"
            );
        }
    }
}

/// Pairs every model point with its true place.
#[derive(Clone)]
struct TruePairs(Isometry3<f64>);

impl DataAssociation for TruePairs {
    fn associate(
        &mut self,
        _: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let (mover, truth) = (
            RigidTransform::new(camera_from_object),
            RigidTransform::new(&self.0),
        );
        pairs.extend(
            (0..)
                .zip(source)
                .map(|(i, s)| Pair::new(i, mover.surfel(s), i, truth.surfel(s))),
        );
    }
}

/// The returned pose itself must move the points onto their targets.
///
/// If rotations are composed on one side and translations are added on the other, an error of
/// centimeters remains. The loss of the internally moved points does not show it.
#[test]
fn the_returned_pose_moves_points_onto_their_targets_far_from_the_origin() {
    let scene = scene(Household::Hammer, 0.0, &mut rng(35));
    let mut rng = rng(36);
    let metrics: [fn() -> Box<dyn Minimize + Send>; 7] = [
        || Box::new(PointToPoint),
        || Box::new(PointToPlane),
        || Box::new(PlaneToPoint),
        || Box::new(Symmetric),
        || Box::new(Generalized::default()),
        || Box::new(GaussNewton::new(PointToPlane)),
        || Box::new(LevenbergMarquardt::new(PointToPlane)),
    ];
    for (degrees, meters) in [(5.0_f64, 0.01), (15.0, 0.05), (40.0, 0.1)] {
        let truth = Isometry3::translation(3.0, -2.0, 4.0) * scene.truth;
        let init = perturb(&mut rng, &truth, meters, degrees.to_radians());
        for metric in metrics {
            let metric = metric();
            let name = metric.label();
            let mut stage = Icp {
                selection: AllSamples,
                association: TruePairs(truth),
                filter: (),
                metric,
                stop: (Convergence::default(), IterationLimit(40)),
            };
            let outcome = scene.run(&mut stage, &init, &mut ());
            assert!(outcome.iterations > 2, "{name}: more than one step");
            let found = outcome.camera_from_object;
            let off = scene.model.samples().iter().map(|s| {
                let point = s.point.cast::<f64>();
                (found * point - truth * point).norm()
            });
            // At 5 m, `f32` has a resolution of 5·10⁻⁷ m.
            let worst = off.fold(0.0, f64::max);
            assert!(worst < 2e-6, "{name} {degrees}°: {worst}");
        }
    }
}

/// Every evaluation with the bits of its pose.
#[derive(Default)]
struct Evaluations {
    poses: Vec<([u64; 7], hybrid_icp::icp::Evaluation)>,
    last_of_stages: Vec<usize>,
}

impl Observer for Evaluations {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        let pose = bits(event.camera_from_object);
        self.poses.push((pose, event.evaluation));
        ControlFlow::Continue(())
    }

    fn on_stage_end(&mut self, _: &StageEvent<'_>) {
        self.last_of_stages.push(self.poses.len());
    }
}

/// A pose stored after the update, with the residual from before it, is reported wrongly.
///
/// An initial pose that is not evaluated first was ignored.
#[test]
fn the_initial_pose_is_evaluated_first_and_the_returned_pose_was_evaluated() {
    let mut refined = 0;
    for seed in 0..4 {
        let scene = scene(Household::Car, 0.5, &mut rng(40 + seed));
        let init = perturb(&mut rng(50 + seed), &scene.truth, 0.006, 0.12);
        for preset in Preset::ALL {
            let mut seen = Evaluations::default();
            let outcome = scene.run(&mut *preset.build(), &init, &mut seen);
            assert_eq!(seen.poses[0].0, bits(&init), "{preset}");
            let claimed = (
                bits(&outcome.camera_from_object),
                outcome.evaluation.expect("pairs at the initial pose"),
            );
            assert!(seen.poses.contains(&claimed), "{preset}: {outcome:?}");
            refined += usize::from(outcome.verdict == Verdict::Refined);
            // A single stage that compares losses returns the best evaluated pose, up to the
            // tolerance of a rise.
            if let [end] = seen.last_of_stages[..] {
                let losses = seen.poses[..end].iter().map(|(_, e)| e.mean_loss);
                let least = losses.fold(f64::INFINITY, f64::min);
                // A pose that was rejected because it lost pairs may have a lower mean loss.
                let accepted = claimed.1.mean_loss <= least * 1.01;
                let lost = outcome.termination == hybrid_icp::icp::Termination::PairsLost;
                assert!(accepted || lost, "{preset}: {outcome:?}, {least}");
            }
        }
    }
    assert!(refined > 18, "{refined}");
}

/// Absolute thresholds and mixed units make the result depend on the unit of length.
///
/// A scene that is twice as large and twice as far away looks the same. Powers of two do not change
/// the rounding.
#[test]
fn a_scaled_scene_is_refined_alike() {
    let mut compared = 0;
    for (object, seed) in [(Household::Iron, 60), (Household::Hammer, 61)] {
        let small = scene(object, 0.3, &mut rng(seed));
        let init = perturb(&mut rng(seed + 10), &small.truth, 0.004, 0.08);
        for factor in [0.5_f32, 2.0, 4.0] {
            let by = f64::from(factor);
            let scaled = |pose: &Isometry3<f64>| {
                Isometry3::from_parts((pose.translation.vector * by).into(), pose.rotation)
            };
            let mesh = small.model.mesh();
            let vertices = mesh.vertices().iter().map(|p| p * factor).collect();
            let mesh = hybrid_icp::core::TriMesh::new(vertices, mesh.triangles().to_vec()).unwrap();
            let depth = small.observation.depth();
            let pixels = depth.pixels().iter().map(|z| z * factor).collect();
            let depth = DepthImage::from_meters(depth.width(), depth.height(), pixels).unwrap();
            let mask = small.observation.mask().clone();
            let large = Scene {
                model: hybrid_icp::core::Model::new(mesh),
                observation: Observation::new(depth, mask, camera()).unwrap(),
                truth: scaled(&small.truth),
            };
            for preset in Preset::ALL {
                let here = small.run(&mut *preset.build(), &init, &mut ());
                let there = large.run(&mut *preset.build(), &scaled(&init), &mut ());
                assert_eq!(there.iterations, here.iterations, "{preset} × {factor}");
                assert_eq!(there.termination, here.termination, "{preset} × {factor}");
                let expected = scaled(&here.camera_from_object);
                let (angle, distance) = se3::pose_distance(&there.camera_from_object, &expected);
                assert!(
                    angle < 1e-9 && distance < 1e-9 * by,
                    "{preset} × {factor}: {angle} {distance}"
                );
                compared += usize::from(here.verdict == Verdict::Refined);
            }
        }
    }
    assert!(compared > 30, "{compared}");
}

/// A residual must separate a good fit from one that is 11 mm off.
///
/// In normalized coordinates, or for points that were never moved, it does not. A perfect fit must
/// not look like a failure.
#[test]
fn rmse_is_the_distance_in_meters_at_the_pose_and_zero_for_a_perfect_fit() {
    let normal = UnitVector3::new_normalize(Vector3::new(0.0, 0.6, -0.8));
    let at = |offset: Vector3<f32>| -> Correspondences {
        (0..50)
            .map(|i| {
                let target = Surfel {
                    point: [0.01 * i as f32, 0.25, 0.5].into(),
                    normal,
                };
                let source = Surfel {
                    point: target.point + offset,
                    normal,
                };
                Pair::new(i, source, i, target)
            })
            .collect()
    };
    let quality =
        |offset| Quality::of(&Iteration::default(), &at(offset), &mut PointToPlane).unwrap();
    let perfect = quality(Vector3::zeros());
    assert_eq!((perfect.point_rmse, perfect.plane_rmse), (0.0, 0.0));
    // An offset of 11 mm along the normal, and one of 11 mm across it.
    let along = quality(normal.into_inner() * 0.011);
    assert!((along.point_rmse - 0.011).abs() < 1e-7 && (along.plane_rmse - 0.011).abs() < 1e-7);
    let across = quality(Vector3::new(0.0, 0.8, 0.6) * 0.011);
    assert!((across.point_rmse - 0.011).abs() < 1e-7 && across.plane_rmse < 1e-7);
}

/// A hidden minimum number of points would silently skip small and far objects.
#[test]
fn a_far_object_of_a_few_hundred_pixels_is_refined() {
    let model = Household::Car.model().unwrap();
    let camera = PinholeCamera::new(143.1, 143.4, 80.1, 59.8, 160, 120).unwrap();
    let mut rng = rng(70);
    let mut improved = 0;
    for seed in 0..10 {
        let turn = Isometry3::rotation(Vector3::new(0.4, 0.3 * f64::from(seed), 0.2));
        let truth = Isometry3::translation(0.05, -0.04, 1.3) * turn;
        let (depth, mask) = render(&model, &camera, &truth);
        let observation = Observation::new(depth, mask, camera).unwrap();
        let n = observation.n_measured();
        assert!((60..500).contains(&n), "{n} pixels");
        let init = perturb(&mut rng, &truth, 0.015, 0.05);
        let refined = Refiner::preset(Preset::Hybrid).refine(&model, &observation, &init);
        let distance = |pose: &Isometry3<f64>| {
            let center = model.center();
            (pose * center - truth * center).norm()
        };
        let found = distance(&refined.outcome.camera_from_object);
        improved += usize::from(found < 0.5 * distance(&init));
    }
    assert!(improved >= 7, "{improved} of 10");
}

/// Moving the model's centroid to that of the visible points would pull a half-hidden object aside.
#[test]
fn a_half_hidden_object_at_its_true_pose_stays_there() {
    for object in [Household::Iron, Household::Car] {
        let scene = scene(object, 0.0, &mut rng(80));
        let region = scene.observation.region();
        let middle = u32::midpoint(region.u_min, region.u_max);
        let (width, height) = (camera().width(), camera().height());
        let whole = scene.observation.mask().pixels();
        let pixels = camera().region().pixels().zip(whole);
        let half = pixels.map(|((u, _), masked)| *masked && u < middle);
        let mask = Mask::new(width, height, half.collect()).unwrap();
        let depth = scene.observation.depth().clone();
        let observation = Observation::new(depth, mask, camera()).unwrap();
        let stages: [(&str, BoxedStage); 2] = [
            ("point-to-point", Preset::ProjectivePointToPoint.build()),
            ("point-to-plane", {
                Box::new(Icp {
                    selection: VisibleSurface::default(),
                    association: Projective,
                    filter: (),
                    metric: PointToPlane,
                    stop: (Convergence::default(), IterationLimit::default()),
                })
            }),
        ];
        for (name, stage) in stages {
            let refined = Refiner::boxed(stage).refine(&scene.model, &observation, &scene.truth);
            let pose = refined.outcome.camera_from_object;
            let (angle, distance) = se3::pose_distance(&pose, &scene.truth);
            assert!(refined.outcome.n_pairs() > 100, "{name}: {refined:?}");
            // The centroid of the visible half is centimeters away.
            assert!(
                angle < 1e-4 && distance < 5e-5,
                "{object:?} {name}: {angle} {distance}"
            );
        }
    }
}
