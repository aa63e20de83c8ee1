//! A gate that keeps failed estimates from moving the fused pose.

use hicp_core::{Matrix6, Vector6};

use crate::estimate::{FusionError, PoseEstimate};
use crate::fuser::fuser_trait::{Failure, Fuser, Update};
use crate::motion::{CameraMotion, Transport};
use crate::solution::Solution;

/// The 99.9 % quantile of the χ² distribution with 6 degrees of freedom.
const CHI_SQUARED_6_999: f64 = 22.458;

/// The conditions under which estimates pass.
// Deviation: gate: §V fuses every estimate. `SequentialEstimator::for_object` and `calibrated` skip
// estimates with an MVE above α, because a failed one would stay in the average.
// `SequentialEstimator::paper` has no gate.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gate {
    /// Largest MVE that passes; `None` for no limit. An estimate without an MVE passes.
    pub max_mve: Option<f64>,
    /// Largest squared Mahalanobis distance from the held estimate; `None` for no limit.
    ///
    /// It combines both covariances and the error of the camera, and is only as good as they are:
    /// χ²₆ if they are right.
    pub max_mahalanobis_squared: Option<f64>,
    /// Number of consecutive estimates that contradict the held one, but not each other, after
    /// which the fuser restarts.
    ///
    /// Then the held estimate is probably the wrong one: it is removed, and the last contradicting
    /// one is the new start. `None` and 0 never restart.
    pub restart_after: Option<usize>,
    /// Standard deviation of the camera's place between two images, along each of its axes, meters.
    ///
    /// The distance of an estimate allows for it. It does not weigh estimates: for that, give each
    /// [`CameraMotion`] a covariance.
    pub camera_error_meters: f64,
    /// The same of its rotation, around each of its axes, radians.
    pub camera_error_radians: f64,
}

impl Default for Gate {
    /// The paper's threshold, an MVE of 0.4; 22.458, the 99.9 % quantile of χ²₆; restart after 3;
    /// exact motions of the camera.
    fn default() -> Self {
        Self {
            max_mve: Some(0.4),
            max_mahalanobis_squared: Some(CHI_SQUARED_6_999),
            restart_after: Some(3),
            camera_error_meters: 0.0,
            camera_error_radians: 0.0,
        }
    }
}

/// A fuser behind a [`Gate`]: estimates that fail are not fused.
///
/// Until an estimate passes, the one with the lowest MVE, and the first of equals, is held alone
/// and provisionally. The inner fuser therefore also receives estimates that failed, each after a
/// [`Fuser::reset`]. It is reset again before the first estimate that passes, and before a restart.
/// Use it inside [`SymmetryAware`](crate::SymmetryAware) and not around it,
/// because a symmetric pose is not an outlier.
///
/// ```
/// use hicp_core::{Isometry3, Matrix6};
/// use hicp_fusion::{BatchFuser, Failure, Fuser, FuserConfig, Gate, Gated, PoseEstimate, Update};
/// # fn main() -> Result<(), hicp_fusion::FusionError> {
/// let mut fuser = Gated::new(BatchFuser::average(FuserConfig::default()), Gate::default())?;
/// let sure = Matrix6::identity() * 1e-6;
/// let good = PoseEstimate::new(Isometry3::translation(0.0, 0.0, 0.5), sure)?.with_mve(0.05)?;
/// let wild = PoseEstimate::new(Isometry3::translation(0.3, 0.0, 0.5), sure)?.with_mve(0.05)?;
/// fuser.update(&good);
/// assert!(matches!(fuser.update(&wild), Update::Rejected(Failure::Mahalanobis { .. })));
/// assert_eq!(fuser.estimate(), Some(good));
/// # Ok(()) }
/// ```
#[derive(Clone, Debug)]
pub struct Gated<F> {
    inner: F,
    gate: Gate,
    /// `true` if the held estimate failed the gate.
    provisional: bool,
    /// The last estimate, if it was too far away, and the number of such estimates in a row that
    /// agree with each other.
    contradicting: Option<(PoseEstimate, usize)>,
}

impl<F: Fuser> Gated<F> {
    /// Adds a gate to a fuser.
    ///
    /// # Errors
    ///
    /// [`FusionError::Parameter`] if a limit is NaN or negative.
    pub fn new(inner: F, gate: Gate) -> Result<Self, FusionError> {
        for (name, limit) in [
            ("largest MVE", gate.max_mve),
            (
                "largest squared Mahalanobis distance",
                gate.max_mahalanobis_squared,
            ),
            (
                "error of the camera, meters",
                Some(gate.camera_error_meters),
            ),
            (
                "error of the camera, radians",
                Some(gate.camera_error_radians),
            ),
        ] {
            if let Some(value) = limit.filter(|limit| limit.is_nan() || *limit < 0.0) {
                return Err(FusionError::Parameter {
                    name,
                    value,
                    expected: "0 or more",
                });
            }
        }
        Ok(Self {
            inner,
            gate,
            provisional: false,
            contradicting: None,
        })
    }

    /// The inner fuser.
    #[must_use]
    pub fn inner(&self) -> &F {
        &self.inner
    }

    fn mve_failure(&self, estimate: &PoseEstimate) -> Option<Failure> {
        let (found, limit) = (estimate.mve?, self.gate.max_mve?);
        (found > limit).then_some(Failure::Mve { found, limit })
    }

    fn distance_failure(&self, estimate: &PoseEstimate, held: &PoseEstimate) -> Option<Failure> {
        let limit = self.gate.max_mahalanobis_squared?;
        let (meters, radians) = (
            self.gate.camera_error_meters,
            self.gate.camera_error_radians,
        );
        let error = Vector6::from_fn(|i, _| if i < 3 { meters } else { radians });
        let mut held = *held;
        held.covariance += Matrix6::from_diagonal(&error.map(|deviation| deviation * deviation));
        let found = estimate.mahalanobis_squared(&held);
        (found > limit).then_some(Failure::Mahalanobis { found, limit })
    }

    /// Replaces everything held by an estimate.
    fn replace(&mut self, estimate: &PoseEstimate) -> Solution {
        self.inner.reset();
        self.contradicting = None;
        // The inner fuser may have another gate and reject the estimate.
        let update = self.inner.update(estimate);
        update.solution().copied().unwrap_or(Solution::NONE)
    }
}

impl<F: Fuser> Fuser for Gated<F> {
    fn propagate(&mut self, motion: &CameraMotion) {
        self.inner.propagate(motion);
        if let Some((last, _)) = &mut self.contradicting {
            *last = motion.carry(last, Transport::Adjoint);
        }
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        let held = self.inner.estimate();
        let failure = self.mve_failure(estimate);
        if let (Some(failure), Some(held)) = (failure, &held) {
            // A provisional estimate is replaced by one that explains its image better.
            let better = estimate.mve.unwrap_or(1.0) < held.mve.unwrap_or(1.0);
            if !(self.provisional && better) {
                return Update::Rejected(failure);
            }
        }
        if let Some(failure) = failure {
            self.provisional = true;
            return Update::Provisional(failure, self.replace(estimate));
        }
        let Some(held) = held else {
            return self.inner.update(estimate);
        };
        if self.provisional {
            self.provisional = false;
            return Update::Accepted(self.replace(estimate));
        }
        if let Some(failure) = self.distance_failure(estimate, &held) {
            // Outliers that also contradict each other do not replace what is held.
            let agrees =
                |(last, _): &(PoseEstimate, usize)| self.distance_failure(estimate, last).is_none();
            let count = 1 + self
                .contradicting
                .filter(agrees)
                .map_or(0, |(_, count)| count);
            if self.gate.restart_after == Some(count) {
                return Update::Restarted(failure, self.replace(estimate));
            }
            self.contradicting = Some((*estimate, count));
            return Update::Rejected(failure);
        }
        self.contradicting = None;
        self.inner.update(estimate)
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.inner.estimate()
    }

    fn reset(&mut self) {
        self.inner.reset();
        self.provisional = false;
        self.contradicting = None;
    }

    fn name(&self) -> &'static str {
        "gated"
    }
}
