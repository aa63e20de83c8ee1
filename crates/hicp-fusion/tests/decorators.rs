//! Gates, and symmetric objects.

// Helpers outside of test functions may fail like tests.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use common::{Random, apart, estimate, relative};
use hicp_core::{
    Isometry3, Matrix6, Point3, Symmetries, SymmetryAxis, Translation3, UnitQuaternion, Vector3,
    se3,
};
use hicp_fusion::{
    BatchFuser, CHI_SQUARED_6_999, CameraMotion, Failure, Fuser, FuserConfig, FusionError,
    FusionMethod, Gate, Gated, PoseEstimate, RecursiveFuser, SharedError, SymmetryAware,
    UnitCovariance, Update,
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

fn x(fuser: &impl Fuser) -> f64 {
    fuser.estimate().unwrap().camera_from_object().translation.x
}

#[test]
fn an_estimate_that_does_not_explain_its_image_is_left_out() {
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
fn one_wild_outlier_does_not_drag_the_pose() {
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
    // 99.9 % of consistent estimates pass: of 4000, about 4 do not.
    let mut random = Random(31);
    let gate = Gate {
        restart_after: None,
        ..Gate::default()
    };
    let truth = random.pose(0.5);
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
    assert!(rejected > 0 || CHI_SQUARED_6_999 > 22.0);
}

#[test]
fn while_nothing_passes_the_best_stands_alone() {
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
    // The first that passes takes its place; after it, failures are left out again.
    assert!(matches!(fuser.update(&at(0.0, 0.2)), Update::Accepted(_)));
    assert_eq!(x(&fuser), 0.0);
    assert!(matches!(fuser.update(&at(0.2, 0.5)), Update::Rejected(_)));
    assert_eq!(x(&fuser), 0.0);
}

#[test]
fn what_all_contradict_is_forgotten() {
    let mut fuser = average(Gate::default());
    fuser.update(&at(0.2, 0.3));
    assert!(matches!(fuser.update(&at(0.0, 0.1)), Update::Rejected(_)));
    assert!(matches!(fuser.update(&at(0.0, 0.1)), Update::Rejected(_)));
    assert!(matches!(fuser.update(&at(0.0, 0.1)), Update::Restarted(..)));
    assert_eq!(x(&fuser), 0.0);
    // Agreement in between starts the count anew.
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
fn a_gate_of_nan_is_refused() {
    for limit in [f64::NAN, -1.0] {
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

fn turned(axis: Vector3<f64>, angle: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(0.02, -0.05, 0.6),
        UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.8, 0.5))
            * UnitQuaternion::from_scaled_axis(axis * angle),
    )
}

fn aware(symmetries: Symmetries) -> SymmetryAware<BatchFuser> {
    let inner = BatchFuser::average(FuserConfig::default());
    SymmetryAware::new(inner, symmetries, Point3::origin(), 0.1).unwrap()
}

#[test]
fn half_turns_of_a_symmetric_object_do_not_fuse_to_a_quarter() {
    let half_turn = Isometry3::rotation(Vector3::z() * PI);
    let with = || Symmetries {
        discrete: vec![half_turn],
        continuous: vec![],
    };
    let slightly = 0.02;
    let poses = [
        turned(Vector3::z(), 0.0),
        turned(Vector3::z(), PI + slightly),
    ];
    let sure = Matrix6::identity() * 1e-4;
    let mut fuser = aware(with());
    let mut naive = BatchFuser::average(FuserConfig::default());
    for pose in poses {
        fuser.update(&estimate(pose, sure));
        naive.update(&estimate(pose, sure));
    }
    let turn = |e: Option<PoseEstimate>| {
        (poses[0].rotation.inverse() * e.unwrap().camera_from_object().rotation).angle()
    };
    assert!((turn(fuser.estimate()) - slightly / 2.0).abs() < 1e-9);
    // Without the symmetry they do: the test can fail.
    assert!((turn(naive.estimate()) - FRAC_PI_2).abs() < 0.02);
}

#[test]
fn every_symmetric_pose_is_brought_home() {
    let cube: Vec<Isometry3<f64>> = (0..4)
        .flat_map(|quarter| {
            let about_z =
                UnitQuaternion::from_scaled_axis(Vector3::z() * FRAC_PI_2 * f64::from(quarter));
            [
                Vector3::zeros(),
                Vector3::x() * FRAC_PI_2,
                Vector3::x() * PI,
                Vector3::x() * -FRAC_PI_2,
                Vector3::y() * FRAC_PI_2,
                Vector3::y() * -FRAC_PI_2,
            ]
            .map(|side| {
                Isometry3::from_parts(
                    Translation3::identity(),
                    UnitQuaternion::from_scaled_axis(side) * about_z,
                )
            })
        })
        .skip(1)
        .collect();
    assert_eq!(cube.len(), 23);
    let fuser = aware(Symmetries {
        discrete: cube.clone(),
        continuous: vec![],
    });
    let mut random = Random(32);
    for _ in 0..20 {
        let reference = random.pose(0.5);
        let near = se3::exp(&random.twist(0.05)) * reference;
        for symmetry in &cube {
            // A group: the inverse of every symmetry is one.
            let found = fuser.representative(&(near * symmetry), &reference);
            assert!(apart(&found, &near) < 1e-12);
        }
        assert_eq!(fuser.representative(&near, &reference), near);
    }
}

#[test]
fn any_turn_about_an_axis_is_brought_home() {
    let offset = Point3::new(0.03, -0.01, 0.0);
    let axis = SymmetryAxis::new(Vector3::new(0.2, 1.0, -0.3), offset).unwrap();
    // The centre of a body of revolution is on its axis.
    let inner = BatchFuser::average(FuserConfig::default());
    let symmetries = Symmetries {
        discrete: vec![],
        continuous: vec![axis],
    };
    let fuser = SymmetryAware::new(inner, symmetries, offset, 0.1).unwrap();
    let reference = turned(Vector3::x(), 0.4);
    for step in 0..37 {
        let angle = TAU * f64::from(step) / 37.0;
        let found = fuser.representative(&(reference * axis.rotation(angle)), &reference);
        assert!(apart(&found, &reference) < 1e-7, "{angle}");
    }
    // The closed form against a search, for poses that are off in other directions too.
    let mut random = Random(33);
    for _ in 0..10 {
        let pose = random.pose(0.5) * reference * axis.rotation(PI * random.uniform());
        let found = fuser.representative(&pose, &reference);
        let angle = |pose: &Isometry3<f64>| se3::pose_distance(pose, &reference).0;
        let best = (0..3600)
            .map(|i| angle(&(pose * axis.rotation(TAU * f64::from(i) / 3600.0))))
            .fold(f64::INFINITY, f64::min);
        assert!(
            (angle(&found) - best).abs() < 1e-5,
            "{} {best}",
            angle(&found)
        );
    }
}

#[test]
fn a_bottle_upside_down_and_turned_is_brought_home() {
    let axis = SymmetryAxis::new(Vector3::z(), Point3::origin()).unwrap();
    let flip = Isometry3::rotation(Vector3::x() * PI);
    let fuser = aware(Symmetries {
        discrete: vec![flip],
        continuous: vec![axis],
    });
    let reference = turned(Vector3::y(), 0.7);
    let pose = reference * axis.rotation(1.9) * flip * axis.rotation(-0.4);
    assert!(apart(&fuser.representative(&pose, &reference), &reference) < 1e-7);
}

#[test]
fn a_sphere_has_no_rotation() {
    let about = |direction| SymmetryAxis::new(direction, Point3::origin()).unwrap();
    let axes = vec![
        about(Vector3::x()),
        about(Vector3::y()),
        about(Vector3::z()),
    ];
    let fuser = aware(Symmetries {
        discrete: vec![],
        continuous: axes,
    });
    let mut random = Random(34);
    for _ in 0..20 {
        let reference = random.pose(1.0);
        let pose = Isometry3::from_parts(reference.translation, random.pose(2.0).rotation);
        let found = fuser.representative(&pose, &reference);
        assert!(se3::pose_distance(&found, &reference).0 < 1e-3);
    }
}

#[test]
fn the_representative_keeps_its_covariance_and_moves_with_the_camera() {
    let half_turn = Isometry3::rotation(Vector3::y() * PI);
    let symmetries = Symmetries {
        discrete: vec![half_turn],
        continuous: vec![],
    };
    let mut random = Random(35);
    let covariance = random.covariance(0.02);
    let pose = turned(Vector3::y(), 0.0);
    let inner = Gated::new(
        RecursiveFuser::filtering(FuserConfig::default()),
        Gate::default(),
    )
    .unwrap();
    let mut fuser = SymmetryAware::new(inner, symmetries, Point3::origin(), 0.1).unwrap();
    fuser.update(&estimate(pose, covariance));
    // The gate inside sees the representative: a symmetric pose is no outlier.
    let update = fuser.update(&estimate(pose * half_turn, covariance));
    assert!(matches!(update, Update::Accepted(_)), "{update:?}");
    let found = fuser.estimate().unwrap();
    assert!(apart(found.camera_from_object(), &pose) < 1e-7);
    assert!(relative(found.covariance(), &(covariance * 0.5)) < 1e-6);
    let broken = Isometry3::translation(f64::NAN, 0.0, 0.0);
    let symmetries = Symmetries {
        discrete: vec![broken],
        continuous: vec![],
    };
    let inner = RecursiveFuser::filtering(FuserConfig::default());
    assert!(SymmetryAware::new(inner, symmetries, Point3::origin(), 0.1).is_err());
}

#[test]
fn a_shared_error_is_stated_but_moves_nothing() {
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

/// Of poses that are equally near, the one that is there stays, bit for bit.
#[test]
fn a_tie_changes_nothing() {
    let fuser = aware(Symmetries {
        discrete: vec![Isometry3::rotation(Vector3::z() * PI)],
        continuous: vec![],
    });
    for turns in [-0.5, 0.5, 1.5] {
        let pose = turned(Vector3::z(), 0.3);
        let reference = pose * Isometry3::rotation(Vector3::z() * PI * turns);
        assert_eq!(fuser.representative(&pose, &reference), pose);
        // A little beyond, and it is the other.
        let beyond = pose * Isometry3::rotation(Vector3::z() * (FRAC_PI_2 + 1e-6));
        assert_ne!(fuser.representative(&pose, &beyond), pose);
    }
}

/// A fuser that does not say its name is called after its type.
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
fn what_stands_around_a_fuser_says_its_name() {
    let inner = || BatchFuser::average(FuserConfig::default());
    assert_eq!(average(Gate::default()).name(), "gated");
    assert_eq!(aware(Symmetries::default()).name(), "symmetry-aware");
    let unit = UnitCovariance::about_object(Point3::origin(), 0.1).unwrap();
    let shared = SharedError::new(inner(), unit, 0.02).unwrap();
    assert_eq!(shared.name(), "shared-error");
}
