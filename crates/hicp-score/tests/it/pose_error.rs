//! Tests of ADD and ADI: the golden case of BOP's reference code, and invariances.

use crate::support::Numbers;
use hicp_core::{Isometry3, Point3, UnitQuaternion, Vector3};
use hicp_score::{add, adi};

/// The corners (±20, ±30, ±40) mm.
pub(crate) fn corners() -> Vec<Point3<f32>> {
    (0..8_u8)
        .map(|i| {
            let side = |bit: u8, half: f32| if i >> bit & 1 == 1 { half } else { -half };
            Point3::new(side(0, 20.0), side(1, 30.0), side(2, 40.0))
        })
        .collect()
}

pub(crate) fn rotation(axis: Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::new(axis * angle)
}

/// Returns the true and the estimated pose of the golden case, in millimeters.
pub(crate) fn golden_poses() -> [Isometry3<f64>; 2] {
    let turn = rotation(Vector3::z(), 0.3);
    let truth = Isometry3::from_parts(Vector3::new(10.0, -5.0, 600.0).into(), turn);
    let tilt = rotation(Vector3::x(), 0.2) * turn;
    let estimate = Isometry3::from_parts(Vector3::new(12.0, -4.0, 605.0).into(), tilt);
    [truth, estimate]
}

#[test]
fn the_golden_case() {
    let [truth, estimate] = golden_poses();
    let expected = 10.932_263_188_943_395;
    assert!((add(&estimate, &truth, &corners()) - expected).abs() < 1e-11);
    assert!((adi(&estimate, &truth, &corners()) - expected).abs() < 1e-11);

    // A half turn around z maps the box onto itself: ADD is 2 √(20² + 30²) for every corner, and
    // ADI is 0.
    let flipped = Isometry3::from_parts(
        truth.translation,
        truth.rotation * rotation(Vector3::z(), std::f64::consts::PI),
    );
    assert!((add(&flipped, &truth, &corners()) - 72.111_025_509_279_78).abs() < 1e-11);
    // The last digit of coordinates of 40 mm is 7e-15, and their rotation rounds three times.
    let found = adi(&flipped, &truth, &corners());
    assert!(found < 2e-14, "{found}");
}

#[test]
fn adi_equals_its_definition_and_is_never_above_add() {
    let mut numbers = Numbers(311);
    for _ in 0..50 {
        let points: Vec<Point3<f32>> = (0..60)
            .map(|_| Point3::from((numbers.vector() * 0.05).cast()))
            .collect();
        let (a, b) = (numbers.pose(0.1), numbers.pose(0.1));
        let (full, nearest) = (add(&a, &b, &points), adi(&a, &b, &points));
        assert!(nearest <= full + 1e-15);
        let moved: Vec<Point3<f64>> = points.iter().map(|p| a * p.cast::<f64>()).collect();
        let sum: f64 = points
            .iter()
            .map(|p| {
                moved
                    .iter()
                    .map(|q| (q - b * p.cast::<f64>()).norm())
                    .fold(f64::INFINITY, f64::min)
            })
            .sum();
        assert!((nearest - sum / 60.0).abs() < 1e-14, "{nearest}");
    }
}

#[test]
fn a_common_motion_changes_nothing() {
    let mut numbers = Numbers(312);
    let points: Vec<Point3<f32>> = (0..60)
        .map(|_| Point3::from((numbers.vector() * 0.05).cast()))
        .collect();
    for _ in 0..50 {
        let (a, b, common) = (numbers.pose(0.1), numbers.pose(0.1), numbers.pose(0.5));
        let difference = add(&(common * a), &(common * b), &points) - add(&a, &b, &points);
        assert!(difference.abs() < 1e-14);
        let difference = adi(&(common * a), &(common * b), &points) - adi(&a, &b, &points);
        assert!(difference.abs() < 1e-14);
        assert_eq!(add(&a, &b, &points), add(&b, &a, &points));
    }
}

#[test]
fn equal_poses_and_no_points_have_no_error() {
    let mut numbers = Numbers(313);
    let points: Vec<Point3<f32>> = (0..20)
        .map(|_| Point3::from((numbers.vector() * 0.05).cast()))
        .collect();
    let pose = numbers.pose(0.5);
    assert_eq!(add(&pose, &pose, &points), 0.0);
    assert!(adi(&pose, &pose, &points) < 1e-15);
    let other = numbers.pose(0.5);
    assert_eq!(
        (add(&pose, &other, &[]), adi(&pose, &other, &[])),
        (0.0, 0.0)
    );
    // A translation is its own error, for every shape.
    let shifted = Isometry3::translation(0.3, 0.0, 0.4) * pose;
    assert!((add(&shifted, &pose, &points) - 0.5).abs() < 1e-14);
}

#[test]
fn points_at_one_place_and_values_that_are_not_finite() {
    let one = vec![Point3::new(0.1_f32, 0.2, 0.3); 200];
    let shifted = Isometry3::translation(0.0, 0.3, 0.4);
    assert!((adi(&shifted, &Isometry3::identity(), &one) - 0.5).abs() < 1e-15);
    let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert_eq!(adi(&nowhere, &shifted, &one), f64::INFINITY);
    assert_eq!(adi(&shifted, &nowhere, &one), f64::INFINITY);
}

#[test]
fn adi_equals_its_definition_for_planes_points_at_one_place_near_and_far() {
    let mut numbers = Numbers(314);
    for (flat, size) in [(false, 0.01), (true, 0.01), (false, 3.0), (true, 3.0)] {
        let mut points: Vec<Point3<f32>> = (0..400)
            .map(|_| Point3::from((numbers.vector() * 0.05).cast()))
            .collect();
        if flat {
            points.iter_mut().for_each(|p| p.z = 0.25);
        }
        let twice = points[..40].to_vec();
        points.extend(twice);
        let (a, b) = (numbers.pose(size), numbers.pose(size));
        let distance = |p: &Point3<f32>| {
            let to = b * p.cast::<f64>();
            let all = points.iter().map(|q| (a * q.cast::<f64>() - to).norm());
            all.fold(f64::INFINITY, f64::min)
        };
        let expected = points.iter().map(distance).sum::<f64>() / 440.0;
        let found = adi(&a, &b, &points);
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    }
}
