//! Estimates that failed do not drag the fused pose.

use crate::estimate::{FusionError, PoseEstimate};
use crate::fuser::{Failure, Fuser, Update};
use crate::motion::CameraMotion;
use crate::solution::Solution;

/// 99.9 % of a χ² variable with 6 degrees of freedom are below this.
pub const CHI_SQUARED_6_999: f64 = 22.458;

/// Which estimates pass.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gate {
    /// Largest MVE that passes; `None` asks for none. An estimate without an MVE passes.
    pub max_mve: Option<f64>,
    /// Largest squared Mahalanobis distance from what is held, by both covariances together; `None`
    /// asks for none. Only as good as the covariances: χ²₆ if they are right.
    pub max_mahalanobis_squared: Option<f64>,
    /// Consecutive estimates too far from what is held after which what is held is the one that is
    /// wrong: it is forgotten, and the last of them starts anew. `None` never gives up, and neither
    /// does 0.
    pub restart_after: Option<usize>,
}

impl Default for Gate {
    /// MVE below the paper's threshold of misalignment, 0.4; the 99.9 % quantile; restart after 3.
    fn default() -> Self {
        Self {
            max_mve: Some(0.4),
            max_mahalanobis_squared: Some(CHI_SQUARED_6_999),
            restart_after: Some(3),
        }
    }
}

/// A fuser behind a [`Gate`]: what fails is not fused.
///
/// While nothing has passed, there is something all the same: the estimate with the lowest MVE, the
/// first of equals, stands provisionally, alone, until the first one passes.
///
/// Inside [`crate::SymmetryAware`], not around it: a symmetric pose is no outlier.
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
    /// What is held failed the gate.
    provisional: bool,
    /// Estimates in a row that were too far away.
    contradictions: usize,
}

impl<F: Fuser> Gated<F> {
    /// Puts a fuser behind a gate.
    ///
    /// # Errors
    ///
    /// [`FusionError::Parameter`] when a limit is NaN or negative.
    pub fn new(inner: F, gate: Gate) -> Result<Self, FusionError> {
        for (name, limit) in [
            ("largest MVE", gate.max_mve),
            (
                "largest squared Mahalanobis distance",
                gate.max_mahalanobis_squared,
            ),
        ] {
            if let Some(value) = limit.filter(|limit| limit.is_nan() || *limit < 0.0) {
                return Err(FusionError::Parameter {
                    name,
                    value,
                    expected: "a number from 0",
                });
            }
        }
        Ok(Self {
            inner,
            gate,
            provisional: false,
            contradictions: 0,
        })
    }

    /// The fuser behind the gate.
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
        let found = estimate.mahalanobis_squared(held);
        (found > limit).then_some(Failure::Mahalanobis { found, limit })
    }

    /// Makes the estimate all that is held.
    fn replace(&mut self, estimate: &PoseEstimate) -> Solution {
        self.inner.reset();
        self.contradictions = 0;
        // The inner fuser may have a gate of its own, and reject the estimate.
        let update = self.inner.update(estimate);
        update.solution().copied().unwrap_or(Solution::NONE)
    }
}

impl<F: Fuser> Fuser for Gated<F> {
    fn propagate(&mut self, motion: &CameraMotion) {
        self.inner.propagate(motion);
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        let held = self.inner.estimate();
        let failure = self.mve_failure(estimate);
        if let (Some(failure), Some(held)) = (failure, &held) {
            // What is held provisionally gives way to what explains its image better.
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
            self.contradictions += 1;
            if self.gate.restart_after == Some(self.contradictions) {
                return Update::Restarted(failure, self.replace(estimate));
            }
            return Update::Rejected(failure);
        }
        self.contradictions = 0;
        self.inner.update(estimate)
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.inner.estimate()
    }

    fn reset(&mut self) {
        self.inner.reset();
        self.provisional = false;
        self.contradictions = 0;
    }

    fn name(&self) -> &'static str {
        "gated"
    }
}
