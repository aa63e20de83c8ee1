//! A pose with its covariance, and the errors of invalid inputs.

use hicp_core::internal::small::{cholesky6, eigen6};
use hicp_core::{Isometry3, Matrix6, se3};
use thiserror::Error;

use crate::information::{information, symmetrized};

/// Largest accepted coordinate of a translation, meters.
pub const MAX_TRANSLATION_METERS: f64 = 1e6;

/// Largest accepted entry of a covariance, m² or rad².
const MAX_VARIANCE: f64 = 1e60;

/// Share of the largest entry up to which asymmetry and negative eigenvalues count as rounding.
const ROUNDING: f64 = 1e-9;

/// An invalid estimate, motion or parameter.
#[derive(Clone, Debug, Error, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum FusionError {
    /// A translation is not finite or beyond [`MAX_TRANSLATION_METERS`].
    #[error(
        "translation of {what} is ({x}, {y}, {z}) m, expected finite numbers within ±{} m",
        MAX_TRANSLATION_METERS
    )]
    Translation {
        /// The name of the transform.
        what: &'static str,
        /// x.
        x: f64,
        /// y.
        y: f64,
        /// z.
        z: f64,
    },
    /// The quaternion of a rotation is not finite or not of unit length.
    #[error("rotation of {what} has a quaternion of length {norm}, expected 1")]
    Rotation {
        /// The name of the transform.
        what: &'static str,
        /// Length of the quaternion.
        norm: f64,
    },
    /// An entry of a covariance is not finite or beyond ±10⁶⁰.
    #[error(
        "covariance entry [{row}][{column}] is {value}, expected a finite number within ±{:e}",
        MAX_VARIANCE
    )]
    CovarianceEntry {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// The value found.
        value: f64,
    },
    /// A covariance is not symmetric.
    #[error(
        "covariance is not symmetric: entry [{row}][{column}] is {value} and its mirror image {mirrored}"
    )]
    CovarianceAsymmetric {
        /// Row from 0.
        row: usize,
        /// Column from 0.
        column: usize,
        /// The value found.
        value: f64,
        /// The value at the mirrored position.
        mirrored: f64,
    },
    /// A covariance has a negative eigenvalue.
    #[error("covariance has the eigenvalue {eigenvalue}, expected 0 or more")]
    CovarianceNegative {
        /// The smallest eigenvalue.
        eigenvalue: f64,
    },
    /// A mean VSD estimate is out of range.
    #[error("mean VSD estimate is {value}, expected 0 to 1")]
    Mve {
        /// The value found.
        value: f64,
    },
    /// A parameter is out of range.
    #[error("{name} is {value}, expected {expected}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// The value found.
        value: f64,
        /// The valid values.
        expected: &'static str,
    },
    /// There are no estimates to fuse.
    #[error("no estimate to fuse, expected one or more")]
    Empty,
}

/// An object's estimated pose in the current camera frame, with its 6×6 covariance and optional
/// MVE.
///
/// The covariance describes a *left* perturbation T = exp(ξ^) T̄ with ξ = [ρ; φ] (meters, then
/// radians) in the camera frame (Barfoot & Furgale 2014; see [`hicp_core::se3`]). It may be
/// singular, or zero.
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
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PoseEstimate {
    pub(crate) camera_from_object: Isometry3<f64>,
    pub(crate) covariance: Matrix6<f64>,
    pub(crate) mve: Option<f64>,
}

impl PoseEstimate {
    /// Creates an estimate. Asymmetry within rounding is averaged.
    ///
    /// # Errors
    ///
    /// [`FusionError`] if the pose is not a rigid motion within ±[`MAX_TRANSLATION_METERS`], or if
    /// the covariance is not symmetric, positive semidefinite and within ±10⁶⁰.
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

    /// Returns the estimate with its mean VSD estimate e_MVE.
    ///
    /// e_MVE is 0 if the pose agrees with the image everywhere, and 1 if it agrees nowhere.
    ///
    /// # Errors
    ///
    /// [`FusionError::Mve`] if it is not between 0 and 1.
    pub fn with_mve(self, mve: f64) -> Result<Self, FusionError> {
        if !(0.0..=1.0).contains(&mve) {
            return Err(FusionError::Mve { value: mve });
        }
        Ok(Self {
            mve: Some(mve),
            ..self
        })
    }

    /// The pose, `camera_from_object`.
    #[must_use]
    pub fn camera_from_object(&self) -> &Isometry3<f64> {
        &self.camera_from_object
    }

    /// The covariance of ξ = [ρ; φ], a left perturbation in the camera frame, m², m·rad and rad².
    #[must_use]
    pub fn covariance(&self) -> &Matrix6<f64> {
        &self.covariance
    }

    /// The mean VSD estimate e_MVE, from 0 (best) to 1, if known.
    #[must_use]
    pub fn mve(&self) -> Option<f64> {
        self.mve
    }

    /// Returns the squared Mahalanobis distance of two independent estimates of one pose.
    ///
    /// The distance is ξᵀ(Σ + Σ′)⁻¹ξ with ξ = ln(T T′⁻¹)^∨. If both covariances are right and
    /// small, it follows χ² with 6 degrees of freedom: mean 6, 99 % below 16.8, 99.9 % below 22.5.
    #[must_use]
    pub fn mahalanobis_squared(&self, other: &Self) -> f64 {
        let xi = se3::log(&(self.camera_from_object * other.camera_from_object.inverse()));
        xi.dot(&(information(&(self.covariance + other.covariance)) * xi))
    }
}

/// Returns an error unless a transform is a rigid motion within ±[`MAX_TRANSLATION_METERS`].
pub(crate) fn check_motion(what: &'static str, motion: &Isometry3<f64>) -> Result<(), FusionError> {
    let t = &motion.translation.vector;
    // Written such that NaN fails.
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

/// Returns a valid covariance, symmetric to the bit, or an error for an invalid one.
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
    if cholesky6(&lifted).is_none() {
        let eigenvalue = eigen6(&symmetric).map_or(f64::NAN, |eigen| eigen.eigenvalues.min());
        return Err(FusionError::CovarianceNegative { eigenvalue });
    }
    Ok(symmetric)
}
