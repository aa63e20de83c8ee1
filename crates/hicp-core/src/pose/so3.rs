//! The rotation group SO(3): exponential, logarithm and left Jacobian.
//!
//! A rotation vector φ is axis × angle, in radians. Closed forms are those of Barfoot & Furgale
//! (T-RO 2014). Below 0.1 rad, where the closed coefficients cancel, a Taylor series replaces them.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Angle (radians) below which coefficients are computed from their series.
///
/// In `f64`, the closed forms lose digits as 1/φ⁵. At 0.1 rad, series and closed form agree to
/// about 1e-11.
pub(crate) const SERIES_ANGLE: f64 = 0.1;

/// Returns φ^, the skew-symmetric matrix with φ^ x = φ × x.
///
/// ```
/// use nalgebra::Vector3;
/// let (a, b) = (Vector3::new(1.0, 2.0, 3.0), Vector3::new(-1.0, 0.5, 2.0));
/// assert!((hicp_core::so3::hat(&a) * b - a.cross(&b)).norm() < 1e-15);
/// ```
#[must_use]
pub fn hat(phi: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(
        0.0, -phi.z, phi.y, //
        phi.z, 0.0, -phi.x, //
        -phi.y, phi.x, 0.0,
    )
}

/// Returns exp(φ^), the rotation by |φ| radians around φ.
///
/// φ must be finite, with components up to 1e150.
///
/// ```
/// use nalgebra::Vector3;
/// let quarter_turn = hicp_core::so3::exp(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
/// assert!((quarter_turn * Vector3::x() - Vector3::y()).norm() < 1e-15);
/// ```
#[must_use]
pub fn exp(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let angle = phi.norm();
    let half = 0.5 * angle;
    // sin(a/2)/a, whose limit at zero is 1/2.
    let factor = if angle < 1e-4 {
        0.5 - angle * angle / 48.0
    } else {
        half.sin() / angle
    };
    let vector = phi * factor;
    UnitQuaternion::new_normalize(Quaternion::new(half.cos(), vector.x, vector.y, vector.z))
}

/// Returns the rotation vector φ = ln(C)^∨ with |φ| ≤ π, radians.
///
/// The quaternion form has no cancellation near π: the axis comes from the vector part, which is
/// largest there. At exactly π both signs of the axis are valid, and one of them is returned.
///
/// ```
/// use nalgebra::Vector3;
/// use hicp_core::so3;
/// let phi = Vector3::new(0.3, -2.0, 1.1);
/// assert!((so3::log(&so3::exp(&phi)) - phi).norm() < 1e-14);
/// ```
#[must_use]
pub fn log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    // q and −q are the same rotation. The one with w ≥ 0 has its angle in [0, π].
    let sign = if rotation.w < 0.0 { -1.0 } else { 1.0 };
    let w = sign * rotation.w;
    let vector = sign * rotation.imag();
    let sine = vector.norm();
    let factor = if sine < 1e-7 {
        // 2 atan(s/w)/s = 2/w − 2 s²/(3 w³) + …, and w³ is 1 up to 2e-14 of that term.
        2.0 / w - sine * sine * (2.0 / 3.0)
    } else {
        2.0 * sine.atan2(w) / sine
    };
    vector * factor
}

/// Returns the angle of a rotation in radians, in [0, π].
#[must_use]
pub fn angle(rotation: &UnitQuaternion<f64>) -> f64 {
    2.0 * rotation.imag().norm().atan2(rotation.w.abs())
}

/// Returns the left Jacobian J(φ) = I + (1−cos a)/a² φ^ + (a−sin a)/a³ φ^², with a = |φ|.
///
/// It maps the translation part of a twist to the translation of its exponential: r = J(φ) ρ.
#[must_use]
pub fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let a2 = phi.norm_squared();
    let a = a2.sqrt();
    let (c1, c2) = if a < SERIES_ANGLE {
        (
            0.5 - a2 / 24.0 + a2 * a2 / 720.0 - a2 * a2 * a2 / 40320.0,
            1.0 / 6.0 - a2 / 120.0 + a2 * a2 / 5040.0 - a2 * a2 * a2 / 362_880.0,
        )
    } else {
        ((1.0 - a.cos()) / a2, (a - a.sin()) / (a2 * a))
    };
    let p = hat(phi);
    Matrix3::identity() + p * c1 + p * p * c2
}

/// Returns J(φ)⁻¹ = I − φ^/2 + c φ^², c = (1 − (a/2) cot(a/2))/a².
#[must_use]
pub fn left_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let a2 = phi.norm_squared();
    let a = a2.sqrt();
    let c = if a < SERIES_ANGLE {
        1.0 / 12.0 + a2 / 720.0 + a2 * a2 / 30240.0 + a2 * a2 * a2 / 1_209_600.0
    } else {
        let half = 0.5 * a;
        (1.0 - half * half.cos() / half.sin()) / a2
    };
    let p = hat(phi);
    Matrix3::identity() - p * 0.5 + p * p * c
}
