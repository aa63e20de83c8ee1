//! Tests of the effect of a moving camera on held estimates.

use crate::common::{EXACT, Random, apart, estimate, exact, fused, relative, run};
use hicp_core::{Isometry3, Matrix6, se3};
use hicp_fusion::{
    BatchFuser, CameraMotion, Fuser, FuserConfig, FusionError, FusionMethod, PoseEstimate,
    RecursiveFuser, UnitCovariance,
};

#[test]
fn a_moved_camera_changes_only_the_frame() {
    let mut random = Random(18);
    let estimates = random.estimates(5, 0.2);
    let motion = random.motion(1.2);
    let adjoint = se3::adjoint(&motion);
    let there: Vec<PoseEstimate> = estimates
        .iter()
        .map(|e| {
            estimate(
                motion * e.camera_from_object(),
                adjoint * e.covariance() * adjoint.transpose(),
            )
        })
        .collect();
    for method in FusionMethod::ALL {
        // Half of the estimates before the motion, the others after it.
        let mut fuser = method.build(exact());
        run(&mut *fuser, &estimates[..3]);
        fuser.propagate(&CameraMotion::new(motion).unwrap());
        let found = run(&mut *fuser, &there[3..]);
        let expected = run(&mut *method.build(exact()), &there);
        assert!(
            apart(found.camera_from_object(), expected.camera_from_object()) < 1e-12,
            "{method}"
        );
        assert!(
            relative(found.covariance(), expected.covariance()) < 1e-11,
            "{method}"
        );
    }
}

#[test]
fn kept_covariances_do_not_change() {
    let mut random = Random(19);
    let motion = CameraMotion::new(random.motion(1.0)).unwrap();
    let estimates = random.estimates(2, 0.3);
    for method in FusionMethod::ALL {
        let mut fuser = method.build(FuserConfig {
            limits: EXACT,
            ..FuserConfig::paper()
        });
        run(&mut *fuser, &estimates[..1]);
        fuser.propagate(&motion);
        let held = fuser.estimate().unwrap();
        assert_eq!(held.covariance(), estimates[0].covariance());
        let expected = motion.apply(estimates[0].camera_from_object());
        assert!(apart(held.camera_from_object(), &expected) < 1e-14);
    }
    // The batch fuses all estimates in the new frame with the old covariances.
    let mut fuser = BatchFuser::weighted_average(FuserConfig {
        limits: EXACT,
        ..FuserConfig::paper()
    });
    run(&mut fuser, &estimates);
    fuser.propagate(&motion);
    let kept: Vec<PoseEstimate> = estimates
        .iter()
        .map(|e| estimate(motion.apply(e.camera_from_object()), *e.covariance()))
        .collect();
    let found = fuser.estimate().unwrap();
    assert!(
        apart(
            found.camera_from_object(),
            fused(&kept).estimate.camera_from_object()
        ) < 1e-13
    );
}

#[test]
fn an_uncertain_motion_adds_its_covariance() {
    let mut random = Random(20);
    let own = random.covariance(0.01);
    let motion = CameraMotion::new(random.motion(0.3)).unwrap();
    let uncertain = motion.with_covariance(&own).unwrap();
    let estimates = random.estimates(3, 0.05);
    for method in FusionMethod::ALL {
        let (mut sure, mut unsure) = (method.build(exact()), method.build(exact()));
        run(&mut *sure, &estimates);
        run(&mut *unsure, &estimates);
        sure.propagate(&motion);
        unsure.propagate(&uncertain);
        let (sure, unsure) = (sure.estimate().unwrap(), unsure.estimate().unwrap());
        assert!(apart(sure.camera_from_object(), unsure.camera_from_object()) < 1e-15);
        let added = unsure.covariance() - sure.covariance();
        assert!(relative(&added, &own) < 1e-10, "{method}");
    }
    // An estimate that was moved by an uncertain motion counts less.
    let here = estimate(
        Isometry3::translation(0.0, 0.0, 0.50),
        Matrix6::identity() * 1e-4,
    );
    let there = estimate(
        Isometry3::translation(0.0, 0.0, 0.51),
        Matrix6::identity() * 1e-4,
    );
    let still = CameraMotion::none()
        .with_covariance(&(Matrix6::identity() * 3e-4))
        .unwrap();
    let mut fuser = RecursiveFuser::filtering(exact());
    fuser.update(&here);
    fuser.propagate(&still);
    fuser.update(&there);
    let z = fuser.estimate().unwrap().camera_from_object().translation.z;
    assert!((z - 0.508).abs() < 1e-12, "{z}");
    assert!(matches!(
        motion.with_covariance(&(own * f64::NAN)),
        Err(FusionError::CovarianceEntry { .. })
    ));
    let nowhere = Isometry3::translation(f64::INFINITY, 0.0, 0.0);
    assert!(matches!(
        CameraMotion::new(nowhere),
        Err(FusionError::Translation { .. })
    ));
}

/// Returns Ad(A) Σ Ad(A)ᵀ.
fn carried(covariance: &Matrix6<f64>, motion: &Isometry3<f64>) -> Matrix6<f64> {
    let adjoint = se3::adjoint(motion);
    adjoint * covariance * adjoint.transpose()
}

/// An estimate that is moved by hand.
struct Held {
    pose: Isometry3<f64>,
    covariance: Matrix6<f64>,
    /// I₆ at the time of the estimate.
    weight: Matrix6<f64>,
}

impl Held {
    fn new(seen: &PoseEstimate) -> Self {
        Self {
            pose: *seen.camera_from_object(),
            covariance: *seen.covariance(),
            weight: Matrix6::identity(),
        }
    }

    fn follow(&mut self, motion: &CameraMotion) {
        let moves = motion.next_camera_from_camera();
        let own = motion.covariance().copied().unwrap_or_default();
        self.pose = moves * self.pose;
        self.covariance = carried(&self.covariance, moves) + own;
        self.weight = carried(&self.weight, moves);
    }
}

/// With alternating known and uncertain motions, every estimate is moved by all motions since its
/// update.
#[test]
fn held_estimates_are_moved_by_every_motion() {
    let mut random = Random(24);
    let (mut center, own) = (random.motion(1.0), random.covariance(0.02));
    let motions: Vec<CameraMotion> = (0..4)
        .map(|index| {
            let motion = CameraMotion::new(random.motion(0.8)).unwrap();
            match index {
                1 | 3 => motion.with_covariance(&own).unwrap(),
                _ => motion,
            }
        })
        .collect();
    assert_eq!(motions[0].covariance(), None);
    assert_eq!(motions[1].covariance(), Some(&own));
    let config = FuserConfig {
        unit: UnitCovariance::Identity,
        ..exact()
    };
    let mut fusers = [
        BatchFuser::weighted_average(config),
        BatchFuser::average(config),
    ];
    let mut held = Vec::new();
    let mut see = |center: &Isometry3<f64>| {
        let pose = se3::exp(&random.twist(0.05)) * center;
        estimate(pose, random.covariance(0.05))
    };
    for motion in &motions {
        for _ in 0..2 {
            let seen = see(&center);
            held.push(Held::new(&seen));
            for fuser in &mut fusers {
                fuser.update(&seen);
            }
        }
        for fuser in &mut fusers {
            fuser.propagate(motion);
        }
        for each in &mut held {
            each.follow(motion);
        }
        center = motion.next_camera_from_camera() * center;
    }
    let last = see(&center);
    held.push(Held::new(&last));
    let [weighted, average] = fusers.each_mut().map(|fuser| run(fuser, &[last]));
    let all = |of: fn(&Held) -> Matrix6<f64>| {
        let estimates: Vec<PoseEstimate> = held.iter().map(|h| estimate(h.pose, of(h))).collect();
        fused(&estimates)
    };
    let expected = all(|h| h.covariance);
    assert!(
        apart(
            weighted.camera_from_object(),
            expected.estimate.camera_from_object()
        ) < 1e-12
    );
    assert!(relative(weighted.covariance(), expected.estimate.covariance()) < 1e-11);
    let expected = all(|h| h.weight);
    assert!(
        apart(
            average.camera_from_object(),
            expected.estimate.camera_from_object()
        ) < 1e-12
    );
}

/// The next fusion starts at the end of the last one, for any motion in between.
#[test]
fn a_motion_costs_no_evaluations() {
    let mut random = Random(25);
    let estimates = random.estimates(6, 0.1);
    let motion = random.motion(1.5);
    for make in [BatchFuser::weighted_average, BatchFuser::average] {
        let config = FuserConfig {
            unit: exact().unit,
            ..FuserConfig::default()
        };
        let (mut still, mut moving) = (make(config), make(config));
        run(&mut still, &estimates[..5]);
        run(&mut moving, &estimates[..5]);
        moving.propagate(&CameraMotion::new(motion).unwrap());
        let last = &estimates[5];
        let there = estimate(
            motion * last.camera_from_object(),
            carried(last.covariance(), &motion),
        );
        let evaluations = |update: hicp_fusion::Update| update.solution().unwrap().iterations;
        assert_eq!(
            evaluations(moving.update(&there)),
            evaluations(still.update(last))
        );
    }
}
