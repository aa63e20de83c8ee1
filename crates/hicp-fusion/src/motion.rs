//! How estimates follow the moving camera.

use hicp_core::{Isometry3, Matrix6, se3};

use crate::error::FusionError;
use crate::estimate::{PoseEstimate, check_motion, checked_covariance, symmetrized};

/// A known motion of the camera, T_C′C of §V: what takes coordinates in the previous camera frame to the next one.
///
/// It may have a covariance of its own, a left perturbation in the *next* camera frame: what the kinematics or the odometry
/// leave uncertain.
///
/// ```
/// use hicp_core::Isometry3;
/// use hicp_fusion::CameraMotion;
/// # fn main() -> Result<(), hicp_fusion::FusionError> {
/// // The camera advances by 1 cm along its optical axis: everything comes nearer.
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
    /// Makes a motion that is known exactly.
    ///
    /// # Errors
    ///
    /// [`FusionError`] when it is not a rigid motion of sensible size.
    pub fn new(next_camera_from_camera: Isometry3<f64>) -> Result<Self, FusionError> {
        check_motion("next_camera_from_camera", &next_camera_from_camera)?;
        Ok(Self {
            next_camera_from_camera,
            covariance: None,
        })
    }

    /// Makes the motion of a camera that stands still.
    #[must_use]
    pub fn none() -> Self {
        Self {
            next_camera_from_camera: Isometry3::identity(),
            covariance: None,
        }
    }

    /// Returns the motion with a covariance of ξ = [ρ; φ], a left perturbation in the next camera frame.
    ///
    /// # Errors
    ///
    /// [`FusionError`] when it is not symmetric and positive semidefinite.
    pub fn with_covariance(self, covariance: &Matrix6<f64>) -> Result<Self, FusionError> {
        Ok(Self {
            covariance: Some(checked_covariance(covariance)?),
            ..self
        })
    }

    /// The motion.
    #[must_use]
    pub fn next_camera_from_camera(&self) -> &Isometry3<f64> {
        &self.next_camera_from_camera
    }

    /// Its covariance, where it is not known exactly.
    #[must_use]
    pub fn covariance(&self) -> Option<&Matrix6<f64>> {
        self.covariance.as_ref()
    }

    /// Returns a pose in the next camera frame.
    #[must_use]
    pub fn apply(&self, camera_from_object: &Isometry3<f64>) -> Isometry3<f64> {
        let mut moved = self.next_camera_from_camera * camera_from_object;
        // Thousands of frames must not let the quaternion drift.
        moved.rotation.renormalize();
        moved
    }
}

/// What happens to the covariance of an estimate when the camera moves by A.
// Deviation: §V moves poses and is silent on covariances; by default they move along. `Transport::Kept` is the plain reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Transport {
    /// Σ′ = Ad(A) Σ Ad(A)ᵀ: the same uncertainty, written in the next camera frame. What is fused then does not depend on the
    /// frame that it is fused in.
    #[default]
    Adjoint,
    /// Σ′ = Σ, the plain reading of §V-A, which moves the poses and does not mention the covariances. What is fused depends on
    /// the frame.
    Kept,
}

/// A motion as it acts on covariances; the adjoint is made once for all estimates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carrier<'a> {
    motion: &'a CameraMotion,
    adjoint: Option<Matrix6<f64>>,
}

impl<'a> Carrier<'a> {
    pub(crate) fn new(motion: &'a CameraMotion, transport: Transport) -> Self {
        Self {
            motion,
            adjoint: match transport {
                Transport::Adjoint => Some(se3::adjoint(&motion.next_camera_from_camera)),
                Transport::Kept => None,
            },
        }
    }

    /// The covariance in the next frame, the motion's own not added.
    pub(crate) fn carried(&self, covariance: &Matrix6<f64>) -> Matrix6<f64> {
        self.adjoint.map_or(*covariance, |adjoint| {
            symmetrized(&(adjoint * covariance * adjoint.transpose()))
        })
    }

    /// The estimate in the next frame: to first order Σ′ = Σ_A + Ad(A) Σ Ad(A)ᵀ.
    pub(crate) fn estimate(&self, estimate: &mut PoseEstimate) {
        estimate.camera_from_object = self.motion.apply(&estimate.camera_from_object);
        estimate.covariance = self.carried(&estimate.covariance);
        if let Some(own) = &self.motion.covariance {
            estimate.covariance += own;
        }
    }
}
