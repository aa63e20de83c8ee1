//! An error that all estimates share.

use crate::estimate::{FusionError, PoseEstimate};
use crate::fuser::fuser_trait::{Fuser, Update};
use crate::motion::CameraMotion;
use crate::unit::UnitCovariance;

/// Adds to the result of a fuser the error that all estimates share.
///
/// Such an error, of the model or of the camera's calibration, does not average out with any number
/// of estimates. The covariances of the estimates describe only their differences; these alone
/// weigh estimates and pass gates. The resulting covariance is that of the inner fuser plus σ² U,
/// with the unit covariance U at the pose. After one update, it is therefore larger than that of
/// the update.
///
/// ```
/// use hicp_core::{Isometry3, Matrix6};
/// use hicp_fusion::{BatchFuser, Fuser, FuserConfig, PoseEstimate, SharedError, UnitCovariance};
/// # fn main() -> Result<(), hicp_fusion::FusionError> {
/// let inner = BatchFuser::weighted_average(FuserConfig::default());
/// let mut fuser = SharedError::new(inner, UnitCovariance::Identity, 0.001)?;
/// let seen = PoseEstimate::new(Isometry3::translation(0.0, 0.0, 0.5), Matrix6::identity() * 1e-4)?;
/// (0..1000).for_each(|_| { fuser.update(&seen); });
/// let variance = fuser.estimate().map_or(0.0, |fused| fused.covariance()[(0, 0)]);
/// assert!((variance - (1e-4 / 1000.0 + 1e-6)).abs() < 1e-12);
/// # Ok(()) }
/// ```
// Deviation: error that all estimates share: §V treats estimates as independent.
// `SequentialEstimator::calibrated` adds the error of the model and of the calibration, which no
// number of estimates averages out, to the resulting covariance.
#[derive(Clone, Debug)]
pub struct SharedError<F> {
    inner: F,
    unit: UnitCovariance,
    variance: f64,
}

impl<F: Fuser> SharedError<F> {
    /// Adds a shared error to a fuser, given its standard deviation in units; 0 adds nothing.
    ///
    /// # Errors
    ///
    /// [`FusionError::Parameter`] if the standard deviation is not between 0 and 10⁶.
    pub fn new(
        inner: F,
        unit: UnitCovariance,
        standard_deviation: f64,
    ) -> Result<Self, FusionError> {
        if !(0.0..=1e6).contains(&standard_deviation) {
            return Err(FusionError::Parameter {
                name: "standard deviation of the shared error",
                value: standard_deviation,
                expected: "0 to 1e6 units",
            });
        }
        Ok(Self {
            inner,
            unit,
            variance: standard_deviation * standard_deviation,
        })
    }

    /// The inner fuser, without the shared error.
    #[must_use]
    pub fn inner(&self) -> &F {
        &self.inner
    }
}

impl<F: Fuser> Fuser for SharedError<F> {
    fn propagate(&mut self, motion: &CameraMotion) {
        self.inner.propagate(motion);
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        self.inner.update(estimate)
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        let mut fused = self.inner.estimate()?;
        fused.covariance += self.unit.at(&fused.camera_from_object) * self.variance;
        Some(fused)
    }

    fn reset(&mut self) {
        self.inner.reset();
    }

    fn name(&self) -> &'static str {
        "shared-error"
    }
}
