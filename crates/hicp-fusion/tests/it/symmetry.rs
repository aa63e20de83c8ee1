//! Tests of estimates of symmetric objects.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::common::{Random, apart, estimate, relative};
use hicp_core::{
    Isometry3, Matrix6, Point3, Symmetries, SymmetryAxis, Translation3, UnitQuaternion, Vector3,
    se3,
};
use hicp_fusion::{
    BatchFuser, Fuser, FuserConfig, Gate, Gated, PoseEstimate, RecursiveFuser, SymmetryAware,
    Update,
};

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
    // Without the symmetry they do, so the test can fail.
    assert!((turn(naive.estimate()) - FRAC_PI_2).abs() < 0.02);
}

#[test]
fn every_symmetric_pose_is_mapped_to_the_representative() {
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
        let reference = random.motion(0.5);
        let near = se3::exp(&random.twist(0.05)) * reference;
        for symmetry in &cube {
            // A group: the inverse of every symmetry is a symmetry.
            let found = fuser.representative(&(near * symmetry), &reference);
            assert!(apart(&found, &near) < 1e-12);
        }
        assert_eq!(fuser.representative(&near, &reference), near);
    }
}

#[test]
fn every_rotation_around_an_axis_is_mapped_to_the_representative() {
    let offset = Point3::new(0.03, -0.01, 0.0);
    let axis = SymmetryAxis::new(Vector3::new(0.2, 1.0, -0.3), offset).unwrap();
    // The center of a body of revolution is on its axis.
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
    // The closed form against a search, for poses that also differ in other directions.
    let mut random = Random(33);
    for _ in 0..10 {
        let pose = random.motion(0.5) * reference * axis.rotation(PI * random.uniform());
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
fn an_inverted_and_rotated_bottle_is_mapped_to_the_representative() {
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

/// Two axes suffice, with any points on them, and even if rounding separates them slightly.
#[test]
fn every_rotation_of_a_sphere_is_a_symmetry() {
    let center = Point3::new(0.03, -0.01, 0.02);
    let through = |direction: Vector3<f64>, along: f64, beside: f64| {
        let beside = Vector3::z() * beside;
        SymmetryAxis::new(direction, center + direction * along + beside).unwrap()
    };
    let oblique = Vector3::new(0.6, 0.8, 0.0);
    let mut random = Random(34);
    for axes in [
        vec![
            through(Vector3::x(), 0.0, 0.0),
            through(Vector3::y(), 0.0, 0.0),
            through(Vector3::z(), 0.0, 0.0),
        ],
        vec![
            through(Vector3::x(), 0.4, 1e-7),
            through(-oblique, 0.7, -1e-7),
        ],
        // The first two are the same.
        vec![
            through(Vector3::z(), 0.1, 0.0),
            through(-Vector3::z(), 0.1, 0.0),
            through(oblique, -0.2, 0.0),
        ],
    ] {
        let symmetries = Symmetries {
            discrete: vec![],
            continuous: axes,
        };
        let inner = BatchFuser::average(FuserConfig::default());
        let fuser = SymmetryAware::new(inner, symmetries, center, 0.1).unwrap();
        for _ in 0..20 {
            let (reference, pose) = (random.motion(1.0), random.motion(2.0));
            let found = fuser.representative(&pose, &reference);
            assert!(se3::pose_distance(&found, &reference).0 < 1e-14);
            // The ball stays at its observed position.
            assert!((found * center - pose * center).norm() < 1e-14);
        }
    }
}

/// An axis that is declared twice with a small difference counts as one.
///
/// A leaning body of revolution therefore does not become upright.
#[test]
fn an_axis_declared_twice_does_not_make_a_sphere() {
    let about = |tilt: f64, along: f64| {
        let offset = Point3::new(0.0, 0.0, along);
        SymmetryAxis::new(Vector3::new(tilt, 0.0, 1.0), offset).unwrap()
    };
    let fuser = aware(Symmetries {
        discrete: vec![],
        continuous: vec![about(0.0, 0.0), about(1e-2, 0.05)],
    });
    let reference = turned(Vector3::z(), 0.2);
    let leaning = reference * Isometry3::rotation(Vector3::x() * 0.3);
    let found = fuser.representative(&(leaning * about(0.0, 0.0).rotation(2.0)), &reference);
    assert!(apart(&found, &leaning) < 3e-2);
}

/// The definition: the nearest pose · S, where rotations count with the radius and translations are
/// those of the center.
///
/// The motions are not a group, so S and S⁻¹ differ.
#[test]
fn the_representative_is_the_nearest_of_all() {
    let mut random = Random(37);
    let (center, radius) = (Point3::new(0.2, -0.1, 0.1), 0.3);
    let mut chosen = std::collections::BTreeSet::new();
    for _ in 0..200 {
        let motions: Vec<Isometry3<f64>> = (0..6).map(|_| random.motion(0.4)).collect();
        let symmetries = Symmetries {
            discrete: motions.clone(),
            continuous: vec![],
        };
        let inner = BatchFuser::average(FuserConfig::default());
        let fuser = SymmetryAware::new(inner, symmetries, center, radius).unwrap();
        let reference = random.motion(1.0);
        let pose = reference * random.motion(0.5);
        let distance = |pose: &Isometry3<f64>| {
            let angle = (pose.rotation * reference.rotation.inverse()).angle();
            angle.powi(2) * radius.powi(2) + (pose * center - reference * center).norm_squared()
        };
        let all: Vec<Isometry3<f64>> = std::iter::once(pose)
            .chain(motions.iter().map(|motion| pose * motion))
            .collect();
        let nearest = (0..all.len())
            .min_by(|a, b| distance(&all[*a]).total_cmp(&distance(&all[*b])))
            .unwrap();
        chosen.insert(nearest);
        assert!(apart(&fuser.representative(&pose, &reference), &all[nearest]) < 1e-12);
    }
    assert_eq!(chosen.len(), 7, "each is the nearest now and then");
}

/// A pose that is already the nearest does not change in any bit, of unit length or nearly.
#[test]
fn a_pose_represents_itself() {
    let fuser = aware(Symmetries {
        discrete: vec![Isometry3::rotation(Vector3::z() * PI)],
        continuous: vec![SymmetryAxis::new(Vector3::z(), Point3::origin()).unwrap()],
    });
    let mut random = Random(38);
    for longer in [0.0, 1e-9] {
        for _ in 0..20 {
            let mut pose = random.motion(1.0);
            let quaternion = pose.rotation.into_inner() * (1.0 + longer);
            pose.rotation = UnitQuaternion::new_unchecked(quaternion);
            assert_eq!(fuser.representative(&pose, &pose), pose);
        }
    }
}

/// Near the held pose and at any distance from the camera, where a renormalized pose is nearer only
/// by rounding.
#[test]
fn a_pose_without_a_nearer_equivalent_does_not_change() {
    let symmetries = Symmetries {
        discrete: vec![
            Isometry3::identity(),
            Isometry3::rotation(Vector3::z() * PI),
        ],
        continuous: vec![],
    };
    let inner = BatchFuser::average(FuserConfig::default());
    let center = Point3::new(0.02, -0.03, 0.04);
    let fuser = SymmetryAware::new(inner, symmetries, center, 0.1).unwrap();
    let mut random = Random(71);
    for meters in [0.0, 1.0, 1e3] {
        for exponent in 1..10 {
            let offset = 10_f64.powi(-exponent);
            for _ in 0..100 {
                let mut reference = random.motion(1.0);
                reference.translation.vector *= meters;
                let mut pose = reference * random.motion(offset);
                let quaternion = pose.rotation.into_inner() * (1.0 + 1e-15);
                pose.rotation = UnitQuaternion::new_unchecked(quaternion);
                let found = fuser.representative(&pose, &reference);
                assert_eq!(found, pose, "{offset} at {meters} m");
            }
        }
    }
}

/// For every small object and every small rotation.
#[test]
fn a_rotation_by_a_nanoradian_is_reversed() {
    let axis = SymmetryAxis::new(Vector3::z(), Point3::origin()).unwrap();
    let symmetries = Symmetries {
        discrete: vec![],
        continuous: vec![axis],
    };
    let inner = BatchFuser::average(FuserConfig::default());
    let fuser = SymmetryAware::new(inner, symmetries, Point3::origin(), 1e-3).unwrap();
    // Far away, a rotation must be larger to exceed rounding: 2e-13 m per meter.
    for (far, angle, tolerance) in [(0.0, 1e-9, 1e-14), (1.0, 1e-9, 1e-14), (1e3, 1e-5, 1e-12)] {
        let mut reference = turned(Vector3::y(), 0.7);
        reference.translation.vector *= far;
        let found = fuser.representative(&(reference * axis.rotation(angle)), &reference);
        assert!(apart(&found, &reference) < tolerance, "{far}");
    }
}

/// Upside down, every angle around the axis has the same distance, and rounding must not rotate the
/// object.
#[test]
fn an_inverted_object_is_not_rotated_by_rounding() {
    let fuser = aware(Symmetries {
        discrete: vec![],
        continuous: vec![SymmetryAxis::new(Vector3::z(), Point3::origin()).unwrap()],
    });
    let mut random = Random(39);
    let reference = turned(Vector3::y(), 0.7);
    for _ in 0..20 {
        let flip = Isometry3::rotation(Vector3::x() * PI);
        let pose = reference * flip * se3::exp(&random.twist(1e-8));
        assert_eq!(fuser.representative(&pose, &reference), pose);
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
    // The inner gate receives the representative: a symmetric pose is not an outlier.
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

/// Of equally near poses, the given one is kept, bit for bit.
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
        // Slightly beyond, it is the other.
        let beyond = pose * Isometry3::rotation(Vector3::z() * (FRAC_PI_2 + 1e-6));
        assert_ne!(fuser.representative(&pose, &beyond), pose);
    }
}
