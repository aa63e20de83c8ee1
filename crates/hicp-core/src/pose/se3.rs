//! The group of rigid motions SE(3): exponential, logarithm, adjoint and left Jacobian.
//!
//! A twist is ξ = [ρ; φ], **translation first** (meters), then rotation (radians). Increments and
//! uncertainties are *left* perturbations, T ← exp(ξ^) T: for `camera_from_object` they are in the
//! camera frame. Conventions and closed forms are those of Barfoot & Furgale, "Associating
//! Uncertainty with Three-Dimensional Poses", T-RO 2014. Sophus and manif use the same. GTSAM
//! orders rotation first and perturbs on the right.

use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, Vector3, Vector6};

use crate::internal::small::{blocks, join};
use crate::pose::so3::{self, SERIES_ANGLE, hat};

/// Returns exp(ξ^), the rigid motion of a twist ξ = [ρ; φ].
///
/// ```
/// use hicp_core::{Vector6, se3};
/// let twist = Vector6::new(0.1, -0.2, 0.3, 0.5, -1.0, 0.7);
/// assert!((se3::log(&se3::exp(&twist)) - twist).norm() < 1e-14);
/// ```
#[must_use]
pub fn exp(xi: &Vector6<f64>) -> Isometry3<f64> {
    let (rho, phi) = split(xi);
    Isometry3::from_parts(
        Translation3::from(so3::left_jacobian(&phi) * rho),
        so3::exp(&phi),
    )
}

/// Returns the twist ξ = ln(T)^∨ = [ρ; φ] of a rigid motion, with |φ| ≤ π.
#[must_use]
pub fn log(motion: &Isometry3<f64>) -> Vector6<f64> {
    let phi = so3::log(&motion.rotation);
    let rho = so3::left_jacobian_inverse(&phi) * motion.translation.vector;
    join(&rho, &phi)
}

/// Returns the product of two motions, with a normalized quaternion.
///
/// Products of unit quaternions drift off the unit sphere; those of a long run must stay in SO(3).
#[must_use]
pub fn compose(after: &Isometry3<f64>, before: &Isometry3<f64>) -> Isometry3<f64> {
    let mut product = after * before;
    product.rotation.renormalize();
    product
}

/// Returns the adjoint Ad(T) = [C r^C; 0 C], with T exp(ξ^) T⁻¹ = exp((Ad(T) ξ)^).
///
/// If poses move as A T, a left covariance Σ moves as Ad(A) Σ Ad(A)ᵀ.
#[must_use]
pub fn adjoint(motion: &Isometry3<f64>) -> Matrix6<f64> {
    let c = motion.rotation.to_rotation_matrix().into_inner();
    blocks(&c, &(hat(&motion.translation.vector) * c), &c)
}

/// Returns the 6×6 matrix of the Lie bracket, [φ^ ρ^; 0 φ^] (the "curly hat").
///
/// Ad(exp(ξ^)) is its exponential.
#[must_use]
pub fn curly_hat(xi: &Vector6<f64>) -> Matrix6<f64> {
    let (rho, phi) = split(xi);
    blocks(&hat(&phi), &hat(&rho), &hat(&phi))
}

/// Returns the left Jacobian 𝓙(ξ) = Σₙ ξ⋏ⁿ/(n+1)! = [J Q; 0 J].
#[must_use]
pub fn left_jacobian(xi: &Vector6<f64>) -> Matrix6<f64> {
    let (_, phi) = split(xi);
    let j = so3::left_jacobian(&phi);
    blocks(&j, &q_matrix(xi), &j)
}

/// Returns 𝓙(ξ)⁻¹ = [J⁻¹ −J⁻¹QJ⁻¹; 0 J⁻¹].
///
/// To first order ln(exp(δ^) exp(ξ^))^∨ = ξ + 𝓙(ξ)⁻¹ δ.
#[must_use]
pub fn left_jacobian_inverse(xi: &Vector6<f64>) -> Matrix6<f64> {
    let (_, phi) = split(xi);
    let inverse = so3::left_jacobian_inverse(&phi);
    blocks(&inverse, &(-inverse * q_matrix(xi) * inverse), &inverse)
}

/// Returns ξ = ln(T)^∨ and the blocks D and B of 𝓙(ξ)⁻¹ = [D B; 0 D].
///
/// Computing them together shares most of the work.
///
/// ```
/// use hicp_core::{Vector6, se3};
/// let motion = se3::exp(&Vector6::new(0.1, -0.2, 0.3, 0.5, -1.0, 0.7));
/// let (xi, d, b) = se3::log_and_left_jacobian_inverse(&motion);
/// let whole = se3::left_jacobian_inverse(&xi);
/// assert_eq!(xi, se3::log(&motion));
/// assert_eq!((d, b), (whole.fixed_view::<3, 3>(3, 3).into(), whole.fixed_view::<3, 3>(0, 3).into()));
/// ```
#[must_use]
pub fn log_and_left_jacobian_inverse(
    motion: &Isometry3<f64>,
) -> (Vector6<f64>, Matrix3<f64>, Matrix3<f64>) {
    let phi = so3::log(&motion.rotation);
    let inverse = so3::left_jacobian_inverse(&phi);
    let xi = join(&(inverse * motion.translation.vector), &phi);
    (xi, inverse, -inverse * q_matrix(&xi) * inverse)
}

/// Returns the rotation angle (radians) and the translation distance (meters) between two poses.
///
/// Both are poses of one object. The rotation is that of `a · b⁻¹`. The translation is |t_a − t_b|,
/// the distance between the object origins (BOP's RE and TE).
#[must_use]
pub fn pose_distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    (
        so3::angle(&(a.rotation * b.rotation.inverse())),
        (a.translation.vector - b.translation.vector).norm(),
    )
}

/// Returns whether every component of the pose is finite.
#[must_use]
pub fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().all(|x| x.is_finite())
        && pose.rotation.coords.iter().all(|x| x.is_finite())
}

/// Returns Q(ξ) with the coefficients of the reference.
///
/// Below [`SERIES_ANGLE`] it uses series, because m₃ alone would lose ten digits.
fn q_matrix(xi: &Vector6<f64>) -> Matrix3<f64> {
    let (rho, phi) = split(xi);
    let a2 = phi.norm_squared();
    let a = a2.sqrt();
    let (m1, m2, m3) = if a < SERIES_ANGLE {
        let (a4, a6) = (a2 * a2, a2 * a2 * a2);
        (
            1.0 / 6.0 - a2 / 120.0 + a4 / 5040.0 - a6 / 362_880.0,
            1.0 / 24.0 - a2 / 720.0 + a4 / 40320.0 - a6 / 3_628_800.0,
            1.0 / 120.0 - a2 / 2520.0 + a4 / 120_960.0 - a6 / 9_979_200.0,
        )
    } else {
        let (s, c) = a.sin_cos();
        (
            (a - s) / (a2 * a),
            (a2 + 2.0 * c - 2.0) / (2.0 * a2 * a2),
            (2.0 * a - 3.0 * s + a * c) / (2.0 * a2 * a2 * a),
        )
    };
    // With P = φ^, R = ρ^ and s = φ·ρ, the products become outer products and skew matrices:
    // PR = ρφᵀ − sI, RP = φρᵀ − sI, PRP = −sP, PPR + RPP = (φ×(φ×ρ) − 2sφ)^.
    let s = phi.dot(&rho);
    let skew = rho * 0.5 + phi * (s * (m2 - m1)) + phi.cross(&phi.cross(&rho)) * m2;
    let outer = rho * phi.transpose() * m1;
    let diagonal = 2.0 * s * (m3 * a2 - m1);
    hat(&skew)
        + outer
        + outer.transpose()
        + phi * phi.transpose() * (-2.0 * s * m3)
        + Matrix3::from_diagonal_element(diagonal)
}

fn split(xi: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (
        Vector3::new(xi[0], xi[1], xi[2]),
        Vector3::new(xi[3], xi[4], xi[5]),
    )
}
