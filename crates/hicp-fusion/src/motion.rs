//! Motions of the camera, and the transport of estimates along them.

use hicp_core::{Isometry3, Matrix6, se3};

use crate::estimate::{FusionError, PoseEstimate, check_motion, checked_covariance};
use crate::information::transported;

/// A known motion of the camera, T_C′C of §V.
///
/// It maps coordinates in the previous camera frame to the next. It may have a covariance for the
/// uncertainty of the kinematics or the odometry, of a left perturbation in the *next* camera
/// frame.
///
/// ```
/// use hicp_core::Isometry3;
/// use hicp_fusion::CameraMotion;
/// # fn main() -> Result<(), hicp_fusion::FusionError> {
/// // The camera advances by 1 cm along its optical axis: all objects come nearer.
/// let advance = CameraMotion::new(Isometry3::translation(0.0, 0.0, -0.01))?;
/// assert!(advance.covariance().is_none());
/// # Ok(()) }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMotion {
    next_camera_from_camera: Isometry3<f64>,
    covariance: Option<Matrix6<f64>>,
}

impl CameraMotion {
    /// Creates an exactly known motion.
    ///
    /// # Errors
    ///
    /// [`FusionError`] if it is not a rigid motion within ±[`MAX_TRANSLATION_METERS`].
    ///
    /// [`MAX_TRANSLATION_METERS`]: crate::MAX_TRANSLATION_METERS
    pub fn new(next_camera_from_camera: Isometry3<f64>) -> Result<Self, FusionError> {
        check_motion("next_camera_from_camera", &next_camera_from_camera)?;
        Ok(Self::exact(next_camera_from_camera))
    }

    /// Creates the motion of a camera that does not move.
    #[must_use]
    pub fn none() -> Self {
        Self::exact(Isometry3::identity())
    }

    /// Creates a motion from a valid transform.
    pub(crate) fn exact(next_camera_from_camera: Isometry3<f64>) -> Self {
        Self {
            next_camera_from_camera,
            covariance: None,
        }
    }

    /// Returns the motion with a covariance of ξ = [ρ; φ], a left perturbation.
    ///
    /// The perturbation is in the next camera frame.
    ///
    /// # Errors
    ///
    /// [`FusionError`] if it is not symmetric and positive semidefinite.
    pub fn with_covariance(self, covariance: &Matrix6<f64>) -> Result<Self, FusionError> {
        Ok(Self {
            covariance: Some(checked_covariance(covariance)?),
            ..self
        })
    }

    /// The transform from the previous to the next camera frame.
    #[must_use]
    pub fn next_camera_from_camera(&self) -> &Isometry3<f64> {
        &self.next_camera_from_camera
    }

    /// The covariance, unless the motion is exactly known.
    #[must_use]
    pub fn covariance(&self) -> Option<&Matrix6<f64>> {
        self.covariance.as_ref()
    }

    /// Returns a pose in the next camera frame.
    #[must_use]
    pub fn apply(&self, camera_from_object: &Isometry3<f64>) -> Isometry3<f64> {
        se3::compose(&self.next_camera_from_camera, camera_from_object)
    }

    /// Returns an estimate in the next camera frame.
    ///
    /// To first order, the covariance becomes Σ_A + Ad(A) Σ Ad(A)ᵀ, where Σ_A is that of the
    /// motion. With [`Transport::Kept`] it becomes Σ_A + Σ. The MVE does not change. A custom
    /// [`Fuser`](crate::Fuser) calls this in [`propagate`](crate::Fuser::propagate).
    ///
    /// ```
    /// use hicp_core::{Isometry3, Matrix6};
    /// use hicp_fusion::{CameraMotion, PoseEstimate, Transport};
    /// # fn main() -> Result<(), hicp_fusion::FusionError> {
    /// let advance = CameraMotion::new(Isometry3::translation(0.0, 0.0, -0.1))?;
    /// let seen = PoseEstimate::new(Isometry3::translation(0.0, 0.0, 0.5), Matrix6::identity())?;
    /// let next = advance.carry(&seen, Transport::Adjoint);
    /// assert_eq!(next.camera_from_object().translation.z, 0.4);
    /// // A rotation around the old camera's center also moves the object in the new frame.
    /// assert!(next.covariance()[(0, 0)] > 1.0);
    /// # Ok(()) }
    /// ```
    #[must_use]
    pub fn carry(&self, estimate: &PoseEstimate, transport: Transport) -> PoseEstimate {
        let mut covariance = self.carry_weight(&estimate.covariance, transport);
        if let Some(own) = &self.covariance {
            covariance += own;
        }
        PoseEstimate {
            camera_from_object: self.apply(&estimate.camera_from_object),
            covariance,
            mve: estimate.mve,
        }
    }

    /// Returns a covariance in the next camera frame, without adding the motion's own.
    pub(crate) fn carry_weight(
        &self,
        covariance: &Matrix6<f64>,
        transport: Transport,
    ) -> Matrix6<f64> {
        match transport {
            Transport::Adjoint => {
                transported(covariance, &se3::adjoint(&self.next_camera_from_camera))
            }
            Transport::Kept => *covariance,
        }
    }
}

/// The effect of a camera motion A on the covariance of an estimate.
// Deviation: transport of covariances: §V moves poses with the camera and does not mention
// covariances. By default they move along, so that the fused pose does not depend on the frame.
// `Transport::Kept` is the plain reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Transport {
    /// Σ′ = Ad(A) Σ Ad(A)ᵀ: the same uncertainty in the next camera frame.
    ///
    /// The fused estimate then does not depend on the frame in which it is fused.
    #[default]
    Adjoint,
    /// Σ′ = Σ, the plain reading of §V-A, which moves the poses and does not mention covariances.
    ///
    /// The fused estimate then depends on the frame.
    Kept,
}
