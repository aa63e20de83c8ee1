//! Tests of gates and of shared errors.

use crate::common::{Random, estimate, relative};
use hicp_core::{Isometry3, Matrix6, Point3, Symmetries, Vector3, se3};
use hicp_fusion::{
    BatchFuser, CameraMotion, Failure, Fuser, FuserConfig, FusionError, FusionMethod, Gate, Gated,
    PoseEstimate, SharedError, SymmetryAware, UnitCovariance, Update,
};

fn at(x: f64, mve: f64) -> PoseEstimate {
    let pose = Isometry3::translation(x, 0.0, 0.5);
    estimate(pose, Matrix6::identity() * 1e-6)
        .with_mve(mve)
        .unwrap()
}

fn average(gate: Gate) -> Gated<BatchFuser> {
    Gated::new(BatchFuser::average(FuserConfig::default()), gate).unwrap()
}

fn aware() -> SymmetryAware<BatchFuser> {
    let inner = BatchFuser::average(FuserConfig::default());
    SymmetryAware::new(inner, Symmetries::default(), Point3::origin(), 0.1).unwrap()
}

fn x(fuser: &impl Fuser) -> f64 {
    fuser.estimate().unwrap().camera_from_object().translation.x
}

#[test]
fn an_estimate_that_does_not_explain_its_image_is_rejected() {
    let mut fuser = average(Gate {
        max_mahalanobis_squared: None,
        ..Gate::default()
    });
    assert!(matches!(fuser.update(&at(0.0, 0.1)), Update::Accepted(_)));
    let update = fuser.update(&at(0.1, 0.41));
    assert_eq!(
        update,
        Update::Rejected(Failure::Mve {
            found: 0.41,
            limit: 0.4
        })
    );
    assert!(!update.is_taken());
    assert_eq!(x(&fuser), 0.0);
    assert!(matches!(fuser.update(&at(0.01, 0.4)), Update::Accepted(_)));
    assert!((x(&fuser) - 0.005).abs() < 1e-9);
    assert_eq!(fuser.inner().len(), 2);
}

#[test]
fn one_wild_outlier_does_not_move_the_pose() {
    for method in FusionMethod::ALL {
        let gate = Gate {
            max_mve: None,
            ..Gate::default()
        };
        let mut fuser = Gated::new(method.build(FuserConfig::default()), gate).unwrap();
        for offset in [0.0, 1e-4, -1e-4, 2e-4] {
            fuser.update(&at(offset, 0.1));
        }
        let before = fuser.estimate();
        let update = fuser.update(&at(0.2, 0.1));
        assert!(
            matches!(update, Update::Rejected(Failure::Mahalanobis { .. })),
            "{method}"
        );
        assert_eq!(fuser.estimate(), before, "{method}");
    }
}

#[test]
fn the_gate_passes_what_its_covariances_allow() {
    // 99.9 % of consistent estimates pass: of 4000, about 4 fail.
    let mut random = Random(31);
    let gate = Gate {
        restart_after: None,
        ..Gate::default()
    };
    let truth = random.motion(0.5);
    let rejected = (0..4000)
        .filter(|_| {
            let mut fuser = average(gate);
            for _ in 0..2 {
                let covariance = random.covariance(0.01);
                let root = covariance.cholesky().unwrap().l();
                let error = root * hicp_core::Vector6::from_fn(|_, _| random.normal());
                let update = fuser.update(&estimate(se3::exp(&error) * truth, covariance));
                if !update.is_taken() {
                    return true;
                }
            }
            false
        })
        .count();
    assert!((0..=14).contains(&rejected), "{rejected}");
}

#[test]
fn until_one_passes_the_best_is_held_alone() {
    let mut fuser = average(Gate {
        max_mahalanobis_squared: None,
        ..Gate::default()
    });
    assert!(matches!(
        fuser.update(&at(0.3, 0.8)),
        Update::Provisional(Failure::Mve { .. }, _)
    ));
    assert!(matches!(fuser.update(&at(0.4, 0.9)), Update::Rejected(_)));
    assert_eq!(x(&fuser), 0.3);
    assert!(matches!(
        fuser.update(&at(0.2, 0.6)),
        Update::Provisional(..)
    ));
    assert_eq!(x(&fuser), 0.2);
    // The first one that passes replaces it. After that, failures are rejected again.
    assert!(matches!(fuser.update(&at(0.0, 0.2)), Update::Accepted(_)));
    assert_eq!(x(&fuser), 0.0);
    assert!(matches!(fuser.update(&at(0.2, 0.5)), Update::Rejected(_)));
    assert_eq!(x(&fuser), 0.0);
}

/// Of estimates that fail alike, the first is kept.
#[test]
fn an_equally_bad_estimate_is_not_better() {
    let mut fuser = average(Gate::default());
    fuser.update(&at(0.3, 0.8));
    let update = fuser.update(&at(0.4, 0.8));
    assert!(matches!(update, Update::Rejected(_)), "{update:?}");
    assert_eq!(x(&fuser), 0.3);
}

/// A limit is the largest value that passes, including 0.
#[test]
fn the_held_estimate_passes_any_limit() {
    let mut fuser = average(Gate {
        max_mve: Some(0.0),
        max_mahalanobis_squared: Some(0.0),
        restart_after: None,
        ..Gate::default()
    });
    for _ in 0..2 {
        assert!(matches!(fuser.update(&at(0.1, 0.0)), Update::Accepted(_)));
    }
    assert!(matches!(fuser.update(&at(0.1, 1e-9)), Update::Rejected(_)));
    let beside = at(0.1 + 1e-9, 0.0);
    assert!(matches!(fuser.update(&beside), Update::Rejected(_)));
}

#[test]
fn an_estimate_that_all_others_contradict_is_dropped() {
    let mut fuser = average(Gate::default());
    fuser.update(&at(0.2, 0.3));
    assert!(matches!(fuser.update(&at(0.0, 0.1)), Update::Rejected(_)));
    assert!(matches!(fuser.update(&at(0.0, 0.1)), Update::Rejected(_)));
    assert!(matches!(fuser.update(&at(0.0, 0.1)), Update::Restarted(..)));
    assert_eq!(x(&fuser), 0.0);
    // Agreement in between resets the count.
    let mut fuser = average(Gate::default());
    for offset in [0.0, 0.2, 0.2, 0.0, 0.2, 0.2] {
        assert!(!matches!(
            fuser.update(&at(offset, 0.1)),
            Update::Restarted(..)
        ));
    }
    assert_eq!(x(&fuser), 0.0);
}

#[test]
fn outliers_that_contradict_each_other_replace_nothing() {
    let mut fuser = average(Gate::default());
    fuser.update(&at(0.0, 0.1));
    for offset in [0.2, -0.3, 0.4, -0.2, 0.3] {
        assert!(matches!(
            fuser.update(&at(offset, 0.1)),
            Update::Rejected(_)
        ));
    }
    assert_eq!(x(&fuser), 0.0);
    // Those that agree do, also in the frames of a moving camera.
    let aside = CameraMotion::new(Isometry3::translation(0.1, 0.0, 0.0)).unwrap();
    let mut last = fuser.update(&at(0.2, 0.1));
    for offset in [0.3, 0.4] {
        fuser.propagate(&aside);
        last = fuser.update(&at(offset, 0.1));
    }
    assert!(matches!(last, Update::Restarted(..)), "{last:?}");
    assert_eq!(x(&fuser), 0.4);
}

/// An error of the camera moves and rotates the poses of all objects around it.
#[test]
fn a_gate_allows_for_the_error_of_the_camera() {
    let passes = |[meters, radians]: [f64; 2], error: Isometry3<f64>| {
        let mut fuser = average(Gate {
            camera_error_meters: meters,
            camera_error_radians: radians,
            ..Gate::default()
        });
        let pose = Isometry3::translation(0.0, 0.0, 0.5);
        let covariance = Matrix6::identity() * 1e-10;
        fuser.update(&estimate(pose, covariance));
        fuser.update(&estimate(error * pose, covariance)).is_taken()
    };
    let shift = |x| Isometry3::translation(x, 0.0, 0.0);
    let turn = |y| Isometry3::rotation(Vector3::y() * y);
    assert!(!passes([0.0, 0.002], shift(0.004)));
    assert!(passes([0.001, 0.0], shift(0.004)));
    assert!(!passes([0.001, 0.0], shift(0.005)));
    assert!(!passes([0.001, 0.0], turn(0.008)));
    assert!(passes([0.0, 0.002], turn(0.008)));
    assert!(!passes([0.0, 0.002], turn(0.01)));
}

#[test]
fn a_gate_of_nan_is_refused() {
    for limit in [f64::NAN, -1.0] {
        let camera = Gate {
            camera_error_radians: limit,
            ..Gate::default()
        };
        assert!(Gated::new(aware(), camera).is_err());
        let gate = Gate {
            max_mve: Some(limit),
            ..Gate::default()
        };
        let made = Gated::new(BatchFuser::average(FuserConfig::default()), gate);
        assert!(matches!(
            made,
            Err(FusionError::Parameter {
                name: "largest MVE",
                ..
            })
        ));
    }
}

#[test]
fn a_shared_error_adds_covariance_and_keeps_the_pose() {
    let unit = UnitCovariance::about_object(Point3::new(0.01, 0.0, 0.02), 0.08).unwrap();
    let mut random = Random(36);
    let make = || BatchFuser::weighted_average(FuserConfig::default());
    let (mut bare, mut shared) = (make(), SharedError::new(make(), unit, 0.02).unwrap());
    let motion = CameraMotion::new(Isometry3::new(
        Vector3::new(0.1, -0.2, 0.05),
        Vector3::new(0.3, 0.1, -0.2),
    ))
    .unwrap();
    let pose = Isometry3::translation(0.0, 0.1, 0.6);
    for x in [0.0, 0.002, -0.001] {
        let seen = Isometry3::translation(x, 0.0, 0.0) * pose;
        let seen = estimate(seen, random.covariance(1e-3));
        assert_eq!(bare.update(&seen), shared.update(&seen));
    }
    bare.propagate(&motion);
    shared.propagate(&motion);
    let (bare_one, one) = (bare.estimate().unwrap(), shared.estimate().unwrap());
    assert_eq!(one.camera_from_object(), bare_one.camera_from_object());
    let added = one.covariance() - bare_one.covariance();
    let expected = unit.at(one.camera_from_object()) * 4e-4;
    assert!(relative(&added, &expected) < 1e-12);
    for wrong in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(SharedError::new(make(), unit, wrong).is_err());
    }
    shared.reset();
    assert_eq!(shared.estimate(), None);
}

/// A fuser without a name is called after its type.
#[test]
fn a_fuser_without_a_name_has_that_of_its_type() {
    struct Deaf;
    impl Fuser for Deaf {
        fn propagate(&mut self, _: &CameraMotion) {}
        fn update(&mut self, _: &PoseEstimate) -> Update {
            Update::Rejected(Failure::Mve {
                found: 1.0,
                limit: 0.5,
            })
        }
        fn estimate(&self) -> Option<PoseEstimate> {
            None
        }
        fn reset(&mut self) {}
    }
    assert_eq!(Deaf.name(), "Deaf");
    let boxed: Box<dyn Fuser> = Box::new(Deaf);
    assert_eq!(boxed.name(), "Deaf");
}

#[test]
fn decorators_report_their_names() {
    let inner = || BatchFuser::average(FuserConfig::default());
    assert_eq!(average(Gate::default()).name(), "gated");
    assert_eq!(aware().name(), "symmetry-aware");
    let unit = UnitCovariance::about_object(Point3::origin(), 0.1).unwrap();
    let shared = SharedError::new(inner(), unit, 0.02).unwrap();
    assert_eq!(shared.name(), "shared-error");
}

#[test]
fn decorators_forward_propagation_and_reset() {
    let inner = || BatchFuser::average(FuserConfig::default());
    let unit = UnitCovariance::about_object(Point3::origin(), 0.1).unwrap();
    let around: [Box<dyn Fuser>; 4] = [
        Box::new(average(Gate::default())),
        Box::new(aware()),
        Box::new(SharedError::new(inner(), unit, 0.0).unwrap()),
        Box::new(Box::new(inner()) as Box<dyn Fuser>),
    ];
    let motion = Isometry3::new(Vector3::new(0.1, -0.2, 0.05), Vector3::new(0.3, 0.1, -0.2));
    let motion = CameraMotion::new(motion).unwrap();
    for mut fuser in around {
        let mut bare = inner();
        for round in 0..2 {
            bare.update(&at(0.0, 0.1));
            fuser.update(&at(0.0, 0.1));
            bare.propagate(&motion);
            fuser.propagate(&motion);
            let moved = fuser.estimate().unwrap();
            assert_eq!(Some(moved), bare.estimate(), "{} {round}", fuser.name());
            let expected = motion.apply(at(0.0, 0.1).camera_from_object());
            assert_eq!(moved.camera_from_object(), &expected);
            bare.reset();
            fuser.reset();
            assert_eq!(fuser.estimate(), None, "{}", fuser.name());
        }
    }
}
