//! Tests of the rotation group against its definitions (pitfall 17).

use std::f64::consts::PI;

use crate::support::Numbers;
use hicp_core::{Matrix3, Quaternion, UnitQuaternion, Vector3, so3};

/// Every scale at which an implementation may switch formulas, both sides of the series' end, and
/// the half turn.
const ANGLES: [f64; 16] = [
    0.0,
    1e-150,
    1e-12,
    1e-8,
    1e-6,
    0.99e-4,
    1.01e-4,
    1e-3,
    0.1 - 1e-9,
    0.1,
    0.1 + 1e-9,
    1.0,
    2.5,
    3.1,
    PI - 1e-6,
    PI - 1e-9,
];

fn axes() -> Vec<Vector3<f64>> {
    let mut numbers = Numbers(1);
    let mut axes = vec![Vector3::x(), -Vector3::y(), Vector3::z()];
    axes.extend((0..20).map(|_| numbers.direction()));
    axes
}

/// Returns Σ Mⁿ / (n + skip)! by its definition.
fn series(m: &Matrix3<f64>, skip: u32) -> Matrix3<f64> {
    let mut term = Matrix3::identity() / f64::from((1..=skip).product::<u32>().max(1));
    let mut sum = Matrix3::zeros();
    for n in 1_u32..60 {
        sum += term;
        term = term * m / f64::from(n + skip);
    }
    sum
}

#[test]
fn hat_is_the_cross_product() {
    let mut numbers = Numbers(2);
    for _ in 0..20 {
        let (a, b) = (numbers.vector(), numbers.vector());
        assert!(
            (so3::hat(&a) * b - a.cross(&b)).norm() <= 4.0 * f64::EPSILON * a.norm() * b.norm()
        );
        assert_eq!(so3::hat(&a), -so3::hat(&a).transpose());
    }
}

#[test]
fn exp_is_the_matrix_exponential() {
    for axis in axes() {
        for angle in ANGLES.into_iter().chain([PI, 4.0, 6.2]) {
            let phi = axis * angle;
            let rotation = so3::exp(&phi).to_rotation_matrix().into_inner();
            let error = (rotation - series(&so3::hat(&phi), 0)).amax();
            // The series adds terms aⁿ/n!, with a sum of e^a, each rounded: a few ε e^a.
            assert!(
                error < 4.0 * f64::EPSILON * f64::exp(angle),
                "{angle}: {error}"
            );
        }
    }
}

#[test]
fn pitfall_17_log_of_exp_is_the_identity_at_every_angle_below_a_half_turn() {
    for axis in axes() {
        for angle in ANGLES {
            let phi = axis * angle;
            let error = (so3::log(&so3::exp(&phi)) - phi).norm();
            // The tolerance is relative to the angle: a tiny rotation keeps all of its digits.
            assert!(error <= 8.0 * f64::EPSILON * angle, "{angle}: {error}");
            let measured = so3::angle(&so3::exp(&phi));
            assert!(
                (measured - angle).abs() <= 8.0 * f64::EPSILON * angle,
                "{angle}: {measured}"
            );
        }
    }
}

/// Checks the sine of 1e-7, where the logarithm switches from atan2 to its series.
///
/// The second term of the series still counts there: it is 15 units in the last place.
#[test]
fn log_is_accurate_at_the_end_of_its_series() {
    let mut numbers = Numbers(5);
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        for _ in 0..200 {
            let half = numbers.between(0.9e-7, 1.1e-7);
            let (sin, cos) = half.sin_cos();
            let rotation = UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, axis * sin));
            let error = (so3::log(&rotation) - axis * (2.0 * half)).norm();
            // Sine, cosine, quotient, difference and product each have a rounding of at most half
            // an ε.
            assert!(
                error <= 2.5 * f64::EPSILON * (2.0 * half),
                "{half}: {error}"
            );
        }
    }
}

#[test]
fn pitfall_17_a_half_turn_has_an_angle_of_pi_around_one_of_its_two_axes() {
    for axis in axes() {
        let phi = axis * PI;
        let found = so3::log(&so3::exp(&phi));
        let error = (found - phi).norm().min((found + phi).norm());
        assert!(error < 8.0 * f64::EPSILON * PI, "{axis}: {error}");
        // A quaternion whose real part is exactly zero.
        let exact = UnitQuaternion::from_quaternion(Quaternion::from_parts(0.0, axis));
        let found = so3::log(&exact);
        assert!((found.norm() - PI).abs() < 8.0 * f64::EPSILON * PI);
        assert!(found.cross(&phi).norm() < 1e-14);
    }
}

#[test]
fn log_selects_the_angle_of_at_most_half_a_turn() {
    for axis in axes() {
        // 4 radians around an axis are 2π − 4 around the opposite axis, and q and −q are one
        // rotation.
        let rotation = so3::exp(&(axis * 4.0));
        let expected = -axis * (2.0 * PI - 4.0);
        assert!((so3::log(&rotation) - expected).norm() < 1e-14);
        let negated = UnitQuaternion::new_unchecked(-rotation.into_inner());
        assert!((so3::log(&negated) - expected).norm() < 1e-14);
        assert!((so3::angle(&negated) - (2.0 * PI - 4.0)).abs() < 1e-14);
    }
}

#[test]
fn left_jacobian_is_its_series_and_its_inverse_inverts_it() {
    for axis in axes() {
        for angle in ANGLES {
            let phi = axis * angle;
            let jacobian = so3::left_jacobian(&phi);
            let error = (jacobian - series(&so3::hat(&phi), 1)).amax();
            assert!(error < 40.0 * f64::EPSILON, "{angle}: {error}");
            let product = jacobian * so3::left_jacobian_inverse(&phi);
            let error = (product - Matrix3::identity()).amax();
            assert!(error < 40.0 * f64::EPSILON, "{angle}: {error}");
        }
    }
}

#[test]
fn left_jacobian_is_the_derivative_of_exp() {
    let mut numbers = Numbers(3);
    for _ in 0..20 {
        let phi = numbers.vector();
        let delta = numbers.direction() * 1e-6;
        // exp((φ + δ)^) = exp((J δ)^) exp(φ^) to first order; the error is O(|δ|²).
        let left = so3::exp(&(phi + delta)) * so3::exp(&phi).inverse();
        let error = (so3::log(&left) - so3::left_jacobian(&phi) * delta).norm();
        assert!(error < 1e-11, "{error}");
    }
}

#[test]
fn functions_are_continuous_at_the_end_of_the_series() {
    let switch = 0.1;
    for axis in axes() {
        let (below, above) = (
            axis * (switch * (1.0 - 1e-14)),
            axis * (switch * (1.0 + 1e-14)),
        );
        // The functions themselves change by 1e-15. The error of (1 − cos a)/a² is ε/a² ≈ 2e-14,
        // times |φ^| = 0.1.
        let jump = (so3::left_jacobian(&below) - so3::left_jacobian(&above)).amax();
        assert!(jump < 1e-14, "{jump}");
        let inverse = so3::left_jacobian_inverse;
        let jump = (inverse(&below) - inverse(&above)).amax();
        assert!(jump < 1e-14, "{jump}");
    }
}

#[test]
fn pitfall_17_long_products_stay_rotations() {
    let mut numbers = Numbers(4);
    let mut rotation = UnitQuaternion::identity();
    let step = so3::exp(&(numbers.vector() * 0.1));
    for _ in 0..100_000 {
        rotation *= step;
    }
    // Roundings accumulate like a random walk: √100000 · ε ≈ 7e-14. A systematic drift would give
    // 1e5 · ε ≈ 2e-11.
    assert!((rotation.norm() - 1.0).abs() < 3e-11);
    let expected = so3::log(&step).norm() * 1e5 % (2.0 * PI);
    let expected = expected.min(2.0 * PI - expected);
    assert!((so3::angle(&rotation) - expected).abs() < 1e-9);
}
