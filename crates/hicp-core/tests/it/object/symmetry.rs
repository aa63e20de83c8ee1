//! Tests of symmetries as BOP declares and expands them.

use crate::support::Numbers;
use hicp_core::{
    Isometry3, Point3, Symmetries, SymmetryAxis, SymmetryError, UnitQuaternion, UnitVector3,
    Vector3,
};

#[test]
fn symmetries_expand_as_in_bop() {
    let axis = SymmetryAxis::new(Vector3::new(0.0, 0.0, 3.0), Point3::new(0.1, 0.2, 0.0)).unwrap();
    let flip = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    let symmetries = |discrete: usize, continuous: usize| Symmetries {
        discrete: vec![flip; discrete],
        continuous: vec![axis; continuous],
    };
    for (d, c, expected) in [
        (0, 0, 1),
        (1, 0, 2),
        (3, 0, 4),
        (0, 1, 315),
        (1, 1, 630),
        (1, 2, 1260),
    ] {
        let symmetries = symmetries(d, c);
        let motions = symmetries.motions();
        assert_eq!(
            (motions.len(), symmetries.n_motions()),
            (expected, expected)
        );
        assert_eq!(motions[0], Isometry3::identity());
        assert_eq!(symmetries.is_empty(), expected == 1);
    }
    // continuous ∘ discrete: first flipped, then rotated. The steps are 2πi/315.
    let motions = symmetries(1, 1).motions();
    for step in [1, 100, 314] {
        let turn = axis.rotation(std::f64::consts::TAU * step as f64 / 315.0);
        assert_eq!(motions[2 * step], turn);
        assert_eq!(motions[2 * step + 1], turn * flip);
    }
}

#[test]
fn the_symmetry_motions_of_a_cylinder_leave_it_unchanged() {
    let mut numbers = Numbers(61);
    for _ in 0..10 {
        let (offset, direction) = (Point3::from(numbers.vector()), numbers.direction());
        let axis = SymmetryAxis::new(direction * numbers.between(1e-3, 1e3), offset).unwrap();
        assert!((axis.direction().norm() - 1.0).abs() < 1e-15);
        // A half turn around a line that crosses the axis at a right angle swaps the ends.
        let across = UnitVector3::new_normalize(direction.cross(&numbers.direction()));
        let half_turn = UnitQuaternion::from_axis_angle(&across, std::f64::consts::PI);
        let swap = Isometry3::from_parts(
            (offset.coords - half_turn * offset.coords).into(),
            half_turn,
        );
        let symmetries = Symmetries {
            discrete: vec![swap],
            continuous: vec![axis],
        };
        let point = Point3::from(numbers.vector());
        let shape = |p: Point3<f64>| {
            let along = (p - offset).dot(&direction);
            ((p - offset - direction * along).norm(), along.abs())
        };
        let (radius, height) = shape(point);
        for motion in symmetries.motions() {
            let (r, h) = shape(motion * point);
            assert!((r - radius).abs() < 1e-13 && (h - height).abs() < 1e-13);
        }
    }
}

/// Returns the distance that the nearest pose minimizes.
fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>, center: &Point3<f64>, radius: f64) -> f64 {
    let angle = (a.rotation * b.rotation.inverse()).angle();
    (angle * radius).hypot((a * center - b * center).norm())
}

/// The definition: no other motion leads to a nearer pose.
#[test]
fn the_nearest_equivalent_pose_is_not_farther_than_any_motion() {
    let mut numbers = Numbers(62);
    let center = Point3::new(0.03, -0.02, 0.05);
    for _ in 0..10 {
        // A body of revolution whose ends are alike.
        let direction = numbers.direction();
        let across = UnitVector3::new_normalize(direction.cross(&numbers.direction()));
        let half_turn = UnitQuaternion::from_axis_angle(&across, std::f64::consts::PI);
        let symmetries = Symmetries {
            discrete: vec![Isometry3::rotation_wrt_point(half_turn, center)],
            continuous: vec![SymmetryAxis::new(direction, center).unwrap()],
        };
        let pose = |numbers: &mut Numbers| Isometry3::new(numbers.vector(), numbers.vector() * 3.0);
        let (reference, pose) = (pose(&mut numbers), pose(&mut numbers));
        let found = symmetries.nearest_equivalent(&pose, &reference, &center, 0.1);
        let distance = apart(&found, &reference, &center, 0.1);
        let least = (symmetries.motions().iter())
            .map(|motion| apart(&(pose * motion), &reference, &center, 0.1))
            .fold(f64::INFINITY, f64::min);
        assert!(distance <= least + 1e-12, "{distance} {least}");
        // Half a step of 2π/315 is the most that an exact solution gains.
        assert!(least < distance + 0.1 * 0.01, "{distance} {least}");
    }
}

/// Two axes make a sphere, whose rotation never differs.
#[test]
fn the_nearest_equivalent_pose_of_a_sphere_has_the_rotation_of_the_reference() {
    let mut numbers = Numbers(63);
    let center = Point3::new(0.03, -0.02, 0.05);
    let axes = [Vector3::z(), Vector3::x()].map(|axis| SymmetryAxis::new(axis, center).unwrap());
    let symmetries = Symmetries {
        discrete: vec![],
        continuous: axes.to_vec(),
    };
    for _ in 0..20 {
        let pose = Isometry3::new(numbers.vector(), numbers.vector() * 3.0);
        let reference = Isometry3::new(numbers.vector(), numbers.vector() * 3.0);
        let found = symmetries.nearest_equivalent(&pose, &reference, &center, 0.1);
        assert!(found.rotation.angle_to(&reference.rotation) < 1e-7);
        assert!((found * center - pose * center).norm() < 1e-14);
    }
}

#[test]
fn an_axis_needs_a_direction() {
    let (x, origin) = (Vector3::x(), Point3::origin());
    for bad in [
        Vector3::zeros(),
        x * f64::NAN,
        x * f64::INFINITY,
        Vector3::new(1.0, f64::NAN, 0.0),
    ] {
        assert!(matches!(
            SymmetryAxis::new(bad, origin),
            Err(SymmetryError::Axis { .. })
        ));
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let offset = Point3::new(0.0, bad, 0.0);
        assert!(matches!(
            SymmetryAxis::new(x, offset),
            Err(SymmetryError::Offset { .. })
        ));
    }
    // The length does not matter.
    for length in [1e-300, 1e-12, 1.0, 1e200, f64::MAX] {
        let axis = SymmetryAxis::new(x * length, origin).unwrap();
        assert_eq!(axis.direction().into_inner(), x, "{length}");
    }
}
