//! Tests of the sequential estimator along simulated paths (§V, §VI-C).

use hicp_sim::{Household, RelativeGaussian, perturb, rng};
use hicp_tests::{camera, median, render, symmetric_pose_distance};
use hybrid_icp::core::{
    Context, DepthImage, Isometry3, Mask, Matrix6, Model, Observation, Problem, Vector6, se3,
};
use hybrid_icp::fusion::{
    CameraMotion, CovarianceModel, Failure, FuserConfig, FusionError, FusionMethod, Gate, Gated,
    InflatedCovariance, UnitCovariance, Update,
};
use hybrid_icp::icp::{Outcome, Session, Stage, Termination};
use hybrid_icp::score::Score;
use hybrid_icp::{
    Calibration, Preset, SequentialConfig, SequentialEstimator, SequentialEvent, Trace, presets,
};

/// Images of a camera that moves toward an object, with the true poses and the camera motions.
struct Path {
    model: Model,
    frames: Vec<(Observation, Isometry3<f64>, CameraMotion)>,
}

/// Creates an approach from 60 cm by 2 cm and 1° per frame, with depth noise in percent.
fn path(object: Household, frames: usize, noise_percent: f64, seed: u64) -> Path {
    let mut rng = rng(seed);
    let model = object.model().expect("the objects that ship are valid");
    let mut truth = hicp_sim::object_pose(&mut rng, &model.center(), 0.55..0.6, 0.02);
    let advance = se3::exp(&Vector6::new(0.003, 0.0, -0.02, 0.01, 0.014, 0.0));
    let mut motion = CameraMotion::none();
    let frames = (0..frames)
        .map(|_| {
            truth = motion.apply(&truth);
            let (depth, mask) = render(&model, &camera(), &truth);
            let depth = RelativeGaussian {
                percent: noise_percent,
            }
            .apply(&mut rng, &depth);
            let observation = Observation::new(depth, mask, camera()).expect("sizes agree");
            let frame = (observation, truth, motion);
            motion = CameraMotion::new(advance).expect("small");
            frame
        })
        .collect();
    Path { model, frames }
}

fn nothing_seen() -> Observation {
    let camera = camera();
    let (width, height) = (camera.width(), camera.height());
    let depth = DepthImage::from_meters(width, height, vec![0.0; (width * height) as usize]);
    let mask = Mask::new(width, height, vec![false; (width * height) as usize]);
    Observation::new(
        depth.expect("sizes agree"),
        mask.expect("sizes agree"),
        camera,
    )
    .expect("sizes agree")
}

#[test]
fn every_method_follows_an_object_from_a_rough_pose() {
    let path = path(Household::Mug, 5, 0.3, 1);
    for method in FusionMethod::ALL {
        let (_, truth, _) = path.frames[0];
        let init = perturb(&mut rng(2), &truth, 0.006, 0.16);
        let mut estimator =
            SequentialEstimator::for_object(presets::hybrid(), method, &path.model, &init)
                .expect("valid");
        assert_eq!(estimator.camera_from_object(), init);
        let mut fused = None;
        for (observation, truth, motion) in &path.frames {
            let before = fused;
            let step = estimator.step(&path.model, observation, motion);
            // The step starts at the previous fused pose, moved into this frame.
            let expected = before.map_or(init, |pose| motion.apply(&pose));
            let (angle, distance) = se3::pose_distance(&step.init, &expected);
            assert!(angle < 1e-9 && distance < 1e-9, "{method}: {step:?}");
            assert_eq!(step.camera_from_object, estimator.camera_from_object());
            assert!(step.covariance.is_some(), "{method}");
            fused = Some(step.camera_from_object);
            let (angle, distance) =
                symmetric_pose_distance(&step.camera_from_object, truth, path.model.symmetries());
            assert!(
                angle < 0.12 && distance < 0.008,
                "{method}: {angle} {distance}"
            );
        }
    }
}

#[test]
fn fusing_is_better_than_the_last_estimate_where_the_noise_is_large() {
    let mut errors = [FusionMethod::LastEstimate, FusionMethod::Average].map(|method| {
        let errors: Vec<f64> = (0..6)
            .map(|seed| {
                let path = path(Household::Mug, 8, 2.0, 10 + seed);
                let (_, truth, _) = path.frames[0];
                let init = perturb(&mut rng(seed), &truth, 0.003, 0.05);
                let mut estimator = SequentialEstimator::for_object(
                    presets::projective_cascade_point_plane(),
                    method,
                    &path.model,
                    &init,
                )
                .expect("valid");
                let mut pose = init;
                let mut truth = truth;
                for (observation, now, motion) in &path.frames {
                    pose = estimator
                        .step(&path.model, observation, motion)
                        .camera_from_object;
                    truth = *now;
                }
                let center = path.model.center();
                let (angle, _) = se3::pose_distance(&pose, &truth);
                angle * path.model.radius() + (pose * center - truth * center).norm()
            })
            .collect();
        errors
    });
    let [last, average] = errors.each_mut().map(|errors| median(errors));
    assert!(
        average < last,
        "average {average} m, last estimate {last} m"
    );
}

#[test]
fn a_pose_that_a_preset_keeps_is_an_estimate() {
    let path = path(Household::Mug, 4, 0.3, 3);
    for preset in [Preset::Local, Preset::Search, Preset::Auto, Preset::Color] {
        let mut estimator = SequentialEstimator::for_object(
            preset.build(),
            FusionMethod::WeightedAverage,
            &path.model,
            &path.frames[0].1,
        )
        .expect("valid");
        for (observation, _, motion) in &path.frames {
            let step = estimator.step(&path.model, observation, motion);
            assert!(
                matches!(step.event, SequentialEvent::Estimated(_)),
                "{preset}: {:?}",
                step.event
            );
            assert!(step.mve.is_some_and(|mve| mve < 0.1), "{step:?}");
        }
    }
}

#[test]
fn an_empty_image_gives_no_estimate() {
    for preset in [Preset::Hybrid, Preset::Local, Preset::Auto] {
        an_empty_image_gives_no_estimate_of(preset);
    }
}

fn an_empty_image_gives_no_estimate_of(preset: Preset) {
    let path = path(Household::Mug, 2, 0.3, 3);
    let (observation, truth, _) = &path.frames[0];
    let mut estimator =
        SequentialEstimator::for_object(preset.build(), FusionMethod::Average, &path.model, truth)
            .expect("valid");
    let motion = path.frames[1].2;
    let step = estimator.step(&path.model, &nothing_seen(), &motion);
    assert!(
        matches!(step.event, SequentialEvent::NoEstimate(_)),
        "{step:?}"
    );
    assert_eq!((step.covariance, step.mve), (None, None));
    // The initial pose still moves with the camera.
    assert_eq!(step.camera_from_object, motion.apply(truth));

    estimator.restart(truth).expect("valid");
    estimator.step(&path.model, observation, &CameraMotion::none());
    let seen = estimator.camera_from_object();
    let step = estimator.step(&path.model, &nothing_seen(), &motion);
    assert!(matches!(step.event, SequentialEvent::NoEstimate(_)));
    let (angle, distance) = se3::pose_distance(&step.camera_from_object, &motion.apply(&seen));
    assert!(angle < 1e-12 && distance < 1e-12);
    assert!(step.covariance.is_some());
}

/// Refines every image, but returns a wrong pose for one of them.
struct WrongOnce<S> {
    stage: S,
    image: usize,
    seen: usize,
}

impl<S: Stage> Stage for WrongOnce<S> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let mut outcome = self.stage.run(problem, init, session);
        if self.seen == self.image {
            let away = Isometry3::translation(0.08, 0.02, 0.0);
            outcome.camera_from_object = away * outcome.camera_from_object;
        }
        self.seen += 1;
        outcome
    }
}

#[test]
fn a_failed_registration_does_not_drag_the_pose() {
    let path = path(Household::Mug, 4, 0.3, 4);
    let wrong_once = || WrongOnce {
        stage: presets::hybrid(),
        image: 2,
        seen: 0,
    };
    let (_, truth, _) = &path.frames[0];
    let error = |estimator: &mut SequentialEstimator| {
        let mut worst: f64 = 0.0;
        let mut rejected = 0;
        for (observation, truth, motion) in &path.frames {
            let step = estimator.step(&path.model, observation, motion);
            worst = worst.max(se3::pose_distance(&step.camera_from_object, truth).1);
            if let SequentialEvent::Estimated(Update::Rejected(Failure::Mve { found, .. })) =
                step.event
            {
                assert_eq!(Some(found), step.mve);
                rejected += 1;
            }
        }
        (worst, rejected)
    };
    let method = FusionMethod::Average;
    let mut gated =
        SequentialEstimator::for_object(wrong_once(), method, &path.model, truth).expect("valid");
    let (worst, rejected) = error(&mut gated);
    assert_eq!(rejected, 1);
    assert!(worst < 0.004, "{worst}");
    let mut plain = SequentialEstimator::paper(wrong_once(), method, truth).expect("valid");
    assert!(error(&mut plain).0 > 0.02);
}

/// A mask of another object moves the pose away from a good initial one.
#[test]
fn a_failed_first_image_does_not_replace_the_initial_pose() {
    let path = path(Household::Mug, 2, 0.3, 5);
    let other = Household::Carton.model().expect("valid");
    let (_, truth, _) = path.frames[0];
    let aside = Isometry3::translation(0.12, 0.0, 0.0) * truth;
    let (depth, mask) = render(&other, &camera(), &aside);
    let wrong = Observation::new(depth, mask, camera()).expect("sizes agree");
    let init = perturb(&mut rng(6), &truth, 0.005, 0.1);
    let calibration = Calibration::of(Preset::Local);
    let mut estimator = SequentialEstimator::calibrated(
        presets::auto(),
        FusionMethod::WeightedAverage,
        &calibration,
        &path.model,
        &init,
    )
    .expect("valid");
    let first = estimator.step(&path.model, &wrong, &CameraMotion::none());
    assert!(
        matches!(
            first.event,
            SequentialEvent::Estimated(Update::Provisional(..))
        ),
        "{:?}",
        first.event
    );
    let (observation, truth, motion) = &path.frames[1];
    let second = estimator.step(&path.model, observation, motion);
    let (angle, distance) = se3::pose_distance(&second.init, &motion.apply(&init));
    assert!(angle < 1e-9 && distance < 1e-9, "{second:?}");
    assert!(
        matches!(
            second.event,
            SequentialEvent::Estimated(Update::Accepted(_))
        ),
        "{:?}",
        second.event
    );
    assert!(se3::pose_distance(&second.camera_from_object, truth).1 < 0.002);
}

#[test]
fn the_covariance_of_the_registration_reaches_the_fuser() {
    let path = path(Household::Mug, 3, 0.3, 5);
    let (model, truth) = (&path.model, &path.frames[0].1);
    let unit = UnitCovariance::about_object(model.center(), model.radius()).expect("valid");
    let inflated = InflatedCovariance::uncalibrated(unit);
    let config = SequentialConfig {
        covariance: CovarianceModel::Inflated(inflated),
        ..SequentialConfig::default()
    };
    let fuser = FusionMethod::Filtering.build(FuserConfig {
        unit,
        ..FuserConfig::default()
    });
    let fuser = Gated::new(fuser, Gate::default()).expect("valid");
    let mut estimator =
        SequentialEstimator::new(presets::hybrid(), fuser, config, truth).expect("valid");
    let (observation, _, motion) = &path.frames[0];
    let step = estimator.step(model, observation, motion);
    let registration = step.outcome.quality.and_then(|q| q.covariance());
    assert!(registration.is_some());
    let pose = &step.outcome.camera_from_object;
    let expected = inflated.covariance(pose, step.mve, registration.as_ref());
    let found = step.covariance.expect("an estimate");
    assert!((found - expected).amax() < 1e-15 * expected.amax());
    // A second image reduces the uncertainty.
    let (observation, _, motion) = &path.frames[1];
    let second = estimator.step(model, observation, motion).covariance;
    assert!(second.expect("an estimate").determinant() < 0.5 * found.determinant());
}

struct Fixed(f64);

impl Score for Fixed {
    fn score(&mut self, _: &mut Context<'_>, _: &Isometry3<f64>) -> f64 {
        self.0
    }
}

#[test]
fn a_custom_score_and_covariance_reach_the_fuser() {
    let path = path(Household::Mug, 1, 0.3, 5);
    let (observation, truth, motion) = &path.frames[0];
    let variance = |mve: f64, pairs: usize| mve / pairs as f64;
    let estimator =
        SequentialEstimator::paper(presets::hybrid(), FusionMethod::LastEstimate, truth);
    let mut estimator =
        (estimator.expect("valid").with_score(Fixed(0.25))).with_covariance(move |outcome, mve| {
            Matrix6::identity() * variance(mve.expect("a score"), outcome.n_pairs())
        });
    let step = estimator.step(&path.model, observation, motion);
    assert_eq!(step.mve, Some(0.25));
    let expected = Matrix6::identity() * variance(0.25, step.outcome.n_pairs());
    assert_eq!(step.covariance, Some(expected));
    // A score that is not an MVE is refused.
    let mut estimator = estimator.with_score(Fixed(1.5));
    let step = estimator.step(&path.model, observation, motion);
    assert!(matches!(step.event, SequentialEvent::Refused(_)));
}

#[test]
fn a_calibrated_estimator_includes_the_error_that_images_share() {
    let path = path(Household::Mug, 6, 0.5, 5);
    let (model, (_, truth, _)) = (&path.model, &path.frames[0]);
    let calibration = Calibration::HYBRID;
    let init = perturb(&mut rng(6), truth, 0.006, 0.16);
    let mut estimator = SequentialEstimator::calibrated(
        presets::hybrid(),
        FusionMethod::WeightedAverage,
        &calibration,
        model,
        &init,
    )
    .expect("valid");
    let unit = UnitCovariance::about_object(model.center(), model.radius()).expect("valid");
    let mut volumes = Vec::new();
    for (observation, truth, motion) in &path.frames {
        let step = estimator.step(model, observation, motion);
        assert!(
            matches!(step.event, SequentialEvent::Estimated(Update::Accepted(_))),
            "{:?}",
            step.event
        );
        let covariance = step.covariance.expect("an estimate");
        let shared = unit.at(&step.camera_from_object) * calibration.shared.powi(2);
        // The stated covariance without the shared error is a covariance too, and the whole one
        // covers the error.
        assert!((covariance - shared).cholesky().is_some());
        let error = se3::log(&(truth * step.camera_from_object.inverse()));
        let solved = covariance.cholesky().expect("positive").solve(&error);
        assert!(calibration.probability_within(error.dot(&solved)) < 0.99);
        volumes.push((covariance - shared).determinant());
    }
    assert!(volumes[5] < 0.1 * volumes[0], "{volumes:?}");
    let broken = Calibration {
        shared: -1.0,
        ..calibration
    };
    let method = FusionMethod::Average;
    let made = SequentialEstimator::calibrated(presets::hybrid(), method, &broken, model, &init);
    assert!(matches!(made, Err(FusionError::Parameter { .. })));
}

#[test]
fn steps_are_deterministic_and_restart_clears_the_state() {
    let path = path(Household::Bottle, 3, 0.5, 6);
    let init = perturb(&mut rng(7), &path.frames[0].1, 0.006, 0.16);
    let make = || {
        let method = FusionMethod::WeightedAverage;
        SequentialEstimator::for_object(presets::hybrid(), method, &path.model, &init)
            .expect("valid")
    };
    let run = |estimator: &mut SequentialEstimator| {
        path.frames
            .iter()
            .map(|(observation, _, motion)| estimator.step(&path.model, observation, motion))
            .collect::<Vec<_>>()
    };
    let mut estimator = make();
    let first = run(&mut estimator);
    estimator.restart(&init).expect("valid");
    assert_eq!(run(&mut estimator), first);
    assert_eq!(run(&mut make()), first);
}

#[test]
fn an_initial_pose_of_nan_is_refused() {
    let init = Isometry3::translation(f64::NAN, 0.0, 0.5);
    let made =
        SequentialEstimator::paper(presets::hybrid(), FusionMethod::Average, &init).map(|_| ());
    assert!(
        matches!(made, Err(FusionError::Translation { .. })),
        "{made:?}"
    );
}

#[test]
fn a_camera_motion_without_an_image_moves_the_pose() {
    let Path { model, frames } = path(Household::Mug, 3, 0.3, 12);
    let (observation, truth, _) = &frames[0];
    let estimator = || {
        let stage = presets::projective_point_to_plane();
        SequentialEstimator::for_object(stage, FusionMethod::Average, &model, truth)
            .expect("a valid start")
    };
    let motion = frames[1].2;
    // Before any estimate, the initial pose moves.
    let mut blind = estimator();
    assert!(blind.fuser().estimate().is_none());
    blind.move_camera(&motion);
    assert_eq!(blind.camera_from_object(), motion.apply(truth));
    // Two motions without an image in between equal one step with both.
    let mut first = estimator();
    let mut trace = Trace::new();
    let step = first.step_observed(&model, observation, &CameraMotion::none(), &mut trace);
    assert_eq!(trace.stages.len(), 1);
    assert_eq!(trace.stages[0].outcome, step.outcome);
    assert_eq!(trace.stages[0].metric, "point-to-plane");
    trace.clear();
    assert_eq!(trace, Trace::new());
    let before = first.camera_from_object();
    first.move_camera(&motion);
    let (angle, distance) = se3::pose_distance(&first.camera_from_object(), &motion.apply(&before));
    assert!(angle < 1e-9 && distance < 1e-9, "{angle} {distance}");
    assert_eq!(first.fuser().estimate(), first.estimate());
    let mut unobserved = estimator();
    assert_eq!(
        unobserved.step(&model, observation, &CameraMotion::none()),
        step
    );
}

/// Ends at the poses of a list, one after another.
struct Listed(std::vec::IntoIter<Isometry3<f64>>);

impl Stage for Listed {
    fn run(&mut self, _: &Problem<'_>, _: &Isometry3<f64>, _: &mut Session<'_>) -> Outcome {
        let pose = self.0.next().expect("a pose per image");
        Outcome::refined(pose, Termination::Converged)
    }
}

#[test]
fn an_estimator_of_an_object_fuses_the_newest_hundred_estimates() {
    let Path { model, frames } = path(Household::Iron, 1, 0.0, 9);
    let (observation, truth, _) = &frames[0];
    let along = |step: i32| Isometry3::translation(f64::from(step) * 1e-6, 0.0, 0.0) * truth;
    let listed = |range: std::ops::Range<i32>| -> Vec<_> { range.map(along).collect() };
    let fused = |poses: Vec<Isometry3<f64>>| {
        let count = poses.len();
        let stage = Listed(poses.into_iter());
        let mut estimator =
            SequentialEstimator::for_object(stage, FusionMethod::Average, &model, truth)
                .expect("the model has a size");
        for _ in 0..count {
            estimator.step(&model, observation, &CameraMotion::none());
        }
        estimator.camera_from_object().translation.vector
    };
    let (all, newest) = (fused(listed(0..130)), fused(listed(30..130)));
    assert!((all - newest).norm() < 1e-12, "{all} {newest}");
    assert!((fused(listed(29..129)) - newest).norm() > 1e-7);
}
