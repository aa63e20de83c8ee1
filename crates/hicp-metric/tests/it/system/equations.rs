//! Tests of normal equations as the author of a custom metric uses them.

use crate::scenes::{AtStart, Numbers, messy};
use hicp_core::{Matrix6, Point3, UnitQuaternion, Vector3, Vector6, se3, so3};
use hicp_metric::{Degeneracy, NormalEquations, PointToPlane};

fn system(seed: u64) -> NormalEquations {
    PointToPlane
        .normal_equations(&messy(&mut Numbers(seed), 60))
        .unwrap()
}

#[test]
fn the_policy_of_a_system_applies_to_its_solution() {
    let system = system(3);
    // Above the ratio of every direction, all but one are degenerate.
    let refused = system.with_policy(Degeneracy::Refuse, 0.999_999);
    assert!(refused.solve().is_none() && system.solve().is_some());
}

#[test]
fn frozen_components_neither_move_nor_rotate_the_center() {
    let mut numbers = Numbers(5);
    let axes = UnitQuaternion::new(numbers.signs());
    let center = Point3::new(0.1, -0.05, 0.7);
    let mut held = system(5);
    let free = held.solve().unwrap();
    held.freeze(&axes, &center, [true, false, false], [false, true, false]);
    let increment = held.solve().unwrap();
    let components = |motion: &hicp_core::Isometry3<f64>| {
        let shift: Vector3<f64> = axes.inverse() * (motion * center - center);
        let turn = axes.inverse() * so3::log(&motion.rotation);
        (shift.x, turn.y, shift.norm(), turn.norm())
    };
    let (x, y, shift, turn) = components(&increment);
    assert!(x.abs() < 1e-12 * shift && y.abs() < 1e-12, "{x} {y}");
    assert!(shift > 1e-6 && turn > 1e-6, "{shift} {turn}");
    let (x, y, ..) = components(&free);
    assert!(x.abs() > 1e-6 && y.abs() > 1e-6, "{x} {y}");
}

#[test]
fn a_twist_with_all_information_is_the_solution() {
    let wanted = Vector6::new(1e-4, -2e-4, 3e-4, 4e-4, -5e-4, 6e-4);
    let plain = system(7);
    let mut pulled = plain;
    pulled.add_twist(&-wanted, &Matrix6::identity(), &(Matrix6::identity() * 1e9));
    let found = se3::log(&pulled.solve().unwrap());
    assert!((found - wanted).norm() < 1e-6, "{found}");
    assert_eq!(pulled.rows(), plain.rows() + 6);
    let expected = plain.loss() + 1e9 * wanted.norm_squared();
    assert!((pulled.loss() / expected - 1.0).abs() < 1e-12);
    // Without information it has no effect.
    let mut same = plain;
    same.add_twist(&-wanted, &Matrix6::identity(), &Matrix6::zeros());
    assert_eq!((same.rows(), same.loss()), (plain.rows(), plain.loss()));
    let difference = same.solve().unwrap().inverse() * plain.solve().unwrap();
    assert!(se3::log(&difference).norm() < 1e-12);
}
