//! Tests of the group of rigid motions against its definitions.

use std::f64::consts::PI;

use crate::support::Numbers;
use hicp_core::{Isometry3, Matrix6, Vector3, Vector6, se3, so3};
use nalgebra::Matrix4;

const ANGLES: [f64; 12] = [
    0.0,
    1e-12,
    1e-6,
    1e-3,
    0.1 - 1e-9,
    0.1,
    0.1 + 1e-9,
    0.5,
    2.0,
    3.0,
    PI - 1e-6,
    PI - 1e-9,
];

/// Twists of every angle, with translations of about a meter.
fn twists() -> Vec<Vector6<f64>> {
    let mut numbers = Numbers(11);
    let mut twists = Vec::new();
    for angle in ANGLES {
        for _ in 0..10 {
            let (rho, phi) = (numbers.vector(), numbers.direction() * angle);
            twists.push(Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z));
        }
    }
    twists
}

fn angle(xi: &Vector6<f64>) -> f64 {
    xi.fixed_rows::<3>(3).norm()
}

/// Returns Σ Mⁿ / (n + skip)!. For |φ| ≤ π, terms reach π³/3! times a few, about 30, before they
/// cancel.
fn series(m: &Matrix6<f64>, skip: u32) -> Matrix6<f64> {
    let mut term = Matrix6::identity() / f64::from((1..=skip).product::<u32>().max(1));
    let mut sum = Matrix6::zeros();
    for n in 1_u32..60 {
        sum += term;
        term = term * m / f64::from(n + skip);
    }
    sum
}

#[test]
fn exp_is_the_matrix_exponential() {
    for xi in twists() {
        let mut hat = Matrix4::zeros();
        let phi = Vector3::new(xi[3], xi[4], xi[5]);
        hat.fixed_view_mut::<3, 3>(0, 0).copy_from(&so3::hat(&phi));
        hat.fixed_view_mut::<3, 1>(0, 3)
            .copy_from(&xi.fixed_rows::<3>(0));
        let (mut term, mut sum) = (Matrix4::identity(), Matrix4::zeros());
        for n in 1_u32..60 {
            sum += term;
            term = term * hat / f64::from(n);
        }
        let error = (se3::exp(&xi).to_homogeneous() - sum).amax();
        assert!(error < 1e-13, "{}: {error}", angle(&xi));
    }
}

#[test]
fn log_of_exp_is_the_identity() {
    for xi in twists() {
        let error = (se3::log(&se3::exp(&xi)) - xi).norm();
        // |ρ| is up to about 4, and the norm of J⁻¹ is up to π/2.
        assert!(error < 2e-14, "{}: {error}", angle(&xi));
    }
}

#[test]
fn exp_of_log_is_the_identity_up_to_half_turns() {
    let mut numbers = Numbers(12);
    for _ in 0..100 {
        let axis = numbers.direction();
        for angle in [0.0, 1e-9, 1.0, PI - 1e-12, PI] {
            let motion = Isometry3::new(numbers.vector(), axis * angle);
            let again = se3::exp(&se3::log(&motion));
            let error = (again.to_homogeneous() - motion.to_homogeneous()).amax();
            assert!(error < 2e-14, "{angle}: {error}");
        }
    }
}

#[test]
fn adjoint_of_exp_is_the_exponential_of_the_curly_hat() {
    for xi in twists() {
        let error = (se3::adjoint(&se3::exp(&xi)) - series(&se3::curly_hat(&xi), 0)).amax();
        assert!(error < 2e-13, "{}: {error}", angle(&xi));
    }
}

#[test]
fn adjoint_transforms_twists() {
    let mut numbers = Numbers(13);
    for xi in twists() {
        let motion = numbers.pose(0.7);
        let carried = motion * se3::exp(&xi) * motion.inverse();
        let expected = se3::exp(&(se3::adjoint(&motion) * xi));
        let error = (carried.to_homogeneous() - expected.to_homogeneous()).amax();
        assert!(error < 1e-13, "{error}");
    }
}

#[test]
fn adjoint_is_a_homomorphism() {
    let mut numbers = Numbers(14);
    for _ in 0..50 {
        let (a, b) = (numbers.pose(1.0), numbers.pose(1.0));
        let product = se3::adjoint(&a) * se3::adjoint(&b);
        assert!((se3::adjoint(&(a * b)) - product).amax() < 1e-13);
        let identity = se3::adjoint(&a) * se3::adjoint(&a.inverse());
        assert!((identity - Matrix6::identity()).amax() < 1e-13);
    }
}

#[test]
fn left_jacobian_is_its_series_and_its_inverse_inverts_it() {
    for xi in twists() {
        let jacobian = se3::left_jacobian(&xi);
        let error = (jacobian - series(&se3::curly_hat(&xi), 1)).amax();
        // Just above the series' end at 0.1, the closed m₂ and m₃ have errors of 1.4e-11 and 9e-11,
        // times a² and a³.
        assert!(error < 1e-13, "{}: {error}", angle(&xi));
        let error = (jacobian * se3::left_jacobian_inverse(&xi) - Matrix6::identity()).amax();
        assert!(error < 1e-13, "{}: {error}", angle(&xi));
    }
}

/// Q is not exact in any closed form, but along the axes its series is summed to the last digit.
#[test]
fn the_coefficients_of_q_are_accurate_to_the_end_of_the_series() {
    for (turn, shift) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
        for angle in [0.02, 0.05, 0.09, 0.1 * (1.0 - 1e-9)] {
            let mut xi = Vector6::zeros();
            (xi[shift], xi[3 + turn]) = (1.0, angle);
            let error = se3::left_jacobian(&xi) - series(&se3::curly_hat(&xi), 1);
            // The largest entry is ½; the tolerance is two of its roundings.
            let error = error.fixed_view::<3, 3>(0, 3).amax();
            assert!(error < f64::EPSILON, "{turn} {shift} {angle}: {error}");
        }
    }
}

#[test]
fn log_and_jacobian_together_equal_the_separate_ones() {
    for xi in twists() {
        let motion = se3::exp(&xi);
        let (log, d, b) = se3::log_and_left_jacobian_inverse(&motion);
        assert_eq!(log, se3::log(&motion));
        let whole = se3::left_jacobian_inverse(&log);
        assert_eq!(whole.fixed_view::<3, 3>(0, 0), d);
        assert_eq!(whole.fixed_view::<3, 3>(0, 3), b);
        assert_eq!(whole.fixed_view::<3, 3>(3, 0).amax(), 0.0);
        assert_eq!(whole.fixed_view::<3, 3>(3, 3), d);
    }
}

#[test]
fn functions_are_continuous_at_the_end_of_the_series() {
    let mut numbers = Numbers(15);
    for _ in 0..50 {
        let (rho, axis) = (numbers.direction(), numbers.direction());
        let at = |a: f64| {
            let phi = axis * a;
            Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
        };
        let (below, above) = (at(0.1 * (1.0 - 1e-14)), at(0.1 * (1.0 + 1e-14)));
        // The error of the closed m₂ is 1.4e-11/24, that of m₃ is 9e-11/120, times a² and a³ (a =
        // 0.1) and a few products: 3e-14.
        let jump = (se3::left_jacobian(&below) - se3::left_jacobian(&above)).amax();
        assert!(jump < 3e-14, "{jump}");
        let inverse = se3::left_jacobian_inverse;
        let jump = (inverse(&below) - inverse(&above)).amax();
        assert!(jump < 3e-14, "{jump}");
        let jump = se3::exp(&below).inverse() * se3::exp(&above);
        assert!(se3::log(&jump).norm() < 1e-14);
    }
}

/// ln(exp(δ^) exp(ξ^)) = ξ + 𝓙(ξ)⁻¹ δ + O(|δ|²): a tenth of δ leaves a hundredth of the error.
#[test]
fn the_first_order_bch_formula_has_a_second_order_error() {
    let mut numbers = Numbers(16);
    let mut judged = 0;
    for _ in 0..50 {
        let xi = se3::log(&numbers.pose(0.5)) * 0.6;
        let direction = se3::log(&numbers.pose(0.5));
        let error = |h: f64, xi: &Vector6<f64>, inverse: &Matrix6<f64>| {
            let delta = direction * h;
            (se3::log(&(se3::exp(&delta) * se3::exp(xi))) - xi - inverse * delta).norm()
        };
        let inverse = se3::left_jacobian_inverse(&xi);
        let (coarse, fine) = (error(1e-3, &xi, &inverse), error(1e-4, &xi, &inverse));
        assert!(
            (80.0..125.0).contains(&(coarse / fine)),
            "{}",
            coarse / fine
        );
        // The right Jacobian instead (the sign error of some references) leaves a first-order
        // error.
        let wrong = se3::left_jacobian_inverse(&-xi);
        let ratio = error(1e-3, &xi, &wrong) / error(1e-4, &xi, &wrong);
        judged += usize::from(ratio < 20.0);
    }
    assert_eq!(judged, 50, "the test must distinguish left from right");
}

#[test]
fn pose_distance_is_bops_re_and_te() {
    // The golden case of BOP's rotation and translation errors.
    let truth = Isometry3::new(Vector3::new(10.0, -5.0, 600.0), Vector3::z() * 0.3);
    let turn = so3::exp(&(Vector3::x() * 0.2)) * truth.rotation;
    let estimate = Isometry3::from_parts(Vector3::new(12.0, -4.0, 605.0).into(), turn);
    let (re, te) = se3::pose_distance(&estimate, &truth);
    assert!((re.to_degrees() - 11.459_155_902_616_464).abs() < 1e-12);
    assert!((te - 5.477_225_575_051_661).abs() < 1e-12);
    assert_eq!(se3::pose_distance(&truth, &truth), (0.0, 0.0));
}

#[test]
fn pose_distance_does_not_depend_on_the_common_frame() {
    let mut numbers = Numbers(17);
    for _ in 0..50 {
        let (a, b, m) = (numbers.pose(1.0), numbers.pose(1.0), numbers.pose(1.0));
        let (angle, distance) = se3::pose_distance(&a, &b);
        let (angle_2, distance_2) = se3::pose_distance(&(m * a), &(m * b));
        assert!((angle - angle_2).abs() < 1e-14 && (distance - distance_2).abs() < 1e-13);
        assert_eq!(se3::pose_distance(&b, &a).1, distance);
    }
}

#[test]
fn a_pose_is_finite_if_every_number_is() {
    let mut numbers = Numbers(18);
    let pose = numbers.pose(1.0);
    assert!(se3::is_finite(&pose));
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for i in 0..3 {
            let mut bad = pose;
            bad.translation.vector[i] = value;
            assert!(!se3::is_finite(&bad));
        }
        for i in 0..4 {
            let mut q = pose.rotation.into_inner();
            q.coords[i] = value;
            let bad = Isometry3::from_parts(pose.translation, nalgebra::Unit::new_unchecked(q));
            assert!(!se3::is_finite(&bad));
        }
    }
}
