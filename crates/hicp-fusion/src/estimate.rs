//! A pose with its covariance.

use hicp_core::{Isometry3, Matrix6, Vector6, se3};
use nalgebra::{Cholesky, SymmetricEigen, U6};

use crate::error::FusionError;

/// Largest coordinate of a translation that is accepted, metres.
pub const MAX_TRANSLATION_METERS: f64 = 1e6;

/// Largest entry of a covariance that is accepted, m² or rad².
pub const MAX_VARIANCE: f64 = 1e60;

/// Share of the largest entry that rounding may take from symmetry and from the smallest eigenvalue.
const ROUNDING: f64 = 1e-9;

/// An estimate of an object's pose in the current camera frame, with its 6×6 covariance and, where known, its MVE.
///
/// The covariance is that of a *left* perturbation, T = exp(ξ^) T̄ with ξ = [ρ; φ] (metres, then radians), and lives in the
/// camera frame: Barfoot & Furgale 2014; see [`hicp_core::se3`]. It may be singular, zero included.
///
/// ```
/// use hicp_core::{Isometry3, Matrix6};
/// use hicp_fusion::{FusionError, PoseEstimate};
/// # fn main() -> Result<(), FusionError> {
/// let pose = Isometry3::translation(0.0, 0.0, 0.5);
/// let estimate = PoseEstimate::new(pose, Matrix6::identity() * 1e-4)?.with_mve(0.12)?;
/// assert_eq!(estimate.mve(), Some(0.12));
/// assert!(matches!(
///     PoseEstimate::new(pose, Matrix6::identity() * f64::NAN),
///     Err(FusionError::CovarianceEntry { row: 0, column: 0, .. })
/// ));
/// # Ok(()) }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseEstimate {
    pub(crate) camera_from_object: Isometry3<f64>,
    pub(crate) covariance: Matrix6<f64>,
    pub(crate) mve: Option<f64>,
}

impl PoseEstimate {
    /// Makes an estimate. Asymmetry within rounding is averaged away.
    ///
    /// # Errors
    ///
    /// [`FusionError`] when the pose is not a rigid motion within ±[`MAX_TRANSLATION_METERS`], or the covariance is not
    /// symmetric, positive semidefinite and within [`MAX_VARIANCE`].
    pub fn new(
        camera_from_object: Isometry3<f64>,
        covariance: Matrix6<f64>,
    ) -> Result<Self, FusionError> {
        check_motion("camera_from_object", &camera_from_object)?;
        Ok(Self {
            camera_from_object,
            covariance: checked_covariance(&covariance)?,
            mve: None,
        })
    }

    /// Returns the estimate with its mean VSD estimate e_MVE, 0 (agrees with the image everywhere) to 1 (nowhere).
    ///
    /// # Errors
    ///
    /// [`FusionError::Mve`] when it is not between 0 and 1.
    pub fn with_mve(self, mve: f64) -> Result<Self, FusionError> {
        if !(0.0..=1.0).contains(&mve) {
            return Err(FusionError::Mve { value: mve });
        }
        Ok(Self {
            mve: Some(mve),
            ..self
        })
    }

    /// The pose.
    #[must_use]
    pub fn camera_from_object(&self) -> &Isometry3<f64> {
        &self.camera_from_object
    }

    /// The covariance of ξ = [ρ; φ], a left perturbation in the camera frame, m², m·rad and rad².
    #[must_use]
    pub fn covariance(&self) -> &Matrix6<f64> {
        &self.covariance
    }

    /// The mean VSD estimate, where known.
    #[must_use]
    pub fn mve(&self) -> Option<f64> {
        self.mve
    }

    /// Returns ξᵀ(Σ + Σ′)⁻¹ξ with ξ = ln(T T′⁻¹)^∨, the squared Mahalanobis distance of two independent estimates of one pose:
    /// χ² with 6 degrees of freedom if both covariances are right and small (mean 6; 99 % below 16.8, 99.9 % below 22.5).
    #[must_use]
    pub fn mahalanobis_squared(&self, other: &Self) -> f64 {
        let xi = se3::log(&(self.camera_from_object * other.camera_from_object.inverse()));
        xi.dot(&(information(&(self.covariance + other.covariance)) * xi))
    }
}

/// Refuses what is not a rigid motion of sensible size.
pub(crate) fn check_motion(what: &'static str, motion: &Isometry3<f64>) -> Result<(), FusionError> {
    let t = &motion.translation.vector;
    // Written so that NaN fails.
    if !t.iter().all(|x| x.abs() <= MAX_TRANSLATION_METERS) {
        let (x, y, z) = (t.x, t.y, t.z);
        return Err(FusionError::Translation { what, x, y, z });
    }
    let norm = motion.rotation.coords.norm();
    if (norm - 1.0).abs() <= 1e-6 {
        Ok(())
    } else {
        Err(FusionError::Rotation { what, norm })
    }
}

/// Refuses what is not a covariance; returns it symmetric to the bit.
pub(crate) fn checked_covariance(covariance: &Matrix6<f64>) -> Result<Matrix6<f64>, FusionError> {
    for row in 0..6 {
        for column in 0..6 {
            let value = covariance[(row, column)];
            if value.is_nan() || value.abs() > MAX_VARIANCE {
                return Err(FusionError::CovarianceEntry { row, column, value });
            }
        }
    }
    let slack = ROUNDING * covariance.amax();
    for row in 0..6 {
        for column in 0..row {
            let (value, mirrored) = (covariance[(row, column)], covariance[(column, row)]);
            if (value - mirrored).abs() > slack {
                return Err(FusionError::CovarianceAsymmetric {
                    row,
                    column,
                    value,
                    mirrored,
                });
            }
        }
    }
    let symmetric = symmetrized(covariance);
    let lifted = symmetric + Matrix6::identity() * (slack + f64::MIN_POSITIVE);
    if lifted.cholesky().is_none() {
        let eigenvalue = symmetric.symmetric_eigenvalues().min();
        return Err(FusionError::CovarianceNegative { eigenvalue });
    }
    Ok(symmetric)
}

/// Returns (Σ + Σᵀ)/2.
pub(crate) fn symmetrized(matrix: &Matrix6<f64>) -> Matrix6<f64> {
    (matrix + matrix.transpose()) * 0.5
}

/// Standard deviation, metres and radians, given to directions in which a singular covariance has none.
pub const MIN_STANDARD_DEVIATION: f64 = 1e-6;

/// Share of its diagonal entry below which a pivot of the Cholesky decomposition is rounding.
const RELATIVE_PIVOT: f64 = 1e-13;

/// Returns Σ⁻¹. A Σ that is singular to working precision has its eigenvalues raised to [`MIN_STANDARD_DEVIATION`]² first.
pub(crate) fn information(covariance: &Matrix6<f64>) -> Matrix6<f64> {
    if let Some(factor) = regular_factor(covariance) {
        return symmetrized(&factor.inverse());
    }
    let (eigenvalues, vectors) = floored_eigen(covariance);
    let inverse = Matrix6::from_diagonal(&eigenvalues.map(|value| 1.0 / value));
    symmetrized(&(vectors * inverse * vectors.transpose()))
}

/// Returns ln det Σ, with the eigenvalues of a singular Σ raised as in [`information`]. Motions do not change it: det Ad = 1.
pub(crate) fn log_determinant(covariance: &Matrix6<f64>) -> f64 {
    if let Some(factor) = regular_factor(covariance) {
        let l = factor.l_dirty();
        return (0..6).map(|i| 2.0 * l[(i, i)].ln()).sum();
    }
    floored_eigen(covariance).0.iter().map(|v| v.ln()).sum()
}

/// The Cholesky decomposition of a covariance that is regular to working precision.
fn regular_factor(covariance: &Matrix6<f64>) -> Option<Factor> {
    let factor = covariance.cholesky()?;
    let l = factor.l_dirty();
    let regular = (0..6).all(|i| {
        let pivot = l[(i, i)] * l[(i, i)];
        pivot > RELATIVE_PIVOT * covariance[(i, i)] && pivot > 1e-20
    });
    regular.then_some(factor)
}

type Factor = Cholesky<f64, U6>;

/// More than any 6×6 matrix needs.
const EIGEN_ITERATIONS: usize = 1000;

/// Eigenvalues, raised to [`MIN_STANDARD_DEVIATION`]², and eigenvectors.
fn floored_eigen(covariance: &Matrix6<f64>) -> (Vector6<f64>, Matrix6<f64>) {
    let least = MIN_STANDARD_DEVIATION * MIN_STANDARD_DEVIATION;
    match SymmetricEigen::try_new(*covariance, f64::EPSILON, EIGEN_ITERATIONS) {
        Some(eigen) => (eigen.eigenvalues.map(|v| v.max(least)), eigen.eigenvectors),
        None => (
            covariance.diagonal().map(|v| v.max(least)),
            Matrix6::identity(),
        ),
    }
}
