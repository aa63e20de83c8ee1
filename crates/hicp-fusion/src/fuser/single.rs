//! Methods that select one estimate and fuse nothing: `last-estimate` and `most-confident`.

use crate::estimate::PoseEstimate;
use crate::fuser::fuser_trait::{Fuser, Update};
use crate::information::log_determinant;
use crate::motion::{CameraMotion, Transport};
use crate::solution::Solution;

/// Returns the latest estimate (§V-A): `last-estimate`.
#[derive(Clone, Debug, Default)]
pub struct LastEstimate {
    transport: Transport,
    held: Option<PoseEstimate>,
}

impl LastEstimate {
    /// Creates the method.
    #[must_use]
    pub fn new(transport: Transport) -> Self {
        Self {
            transport,
            held: None,
        }
    }
}

impl Fuser for LastEstimate {
    fn propagate(&mut self, motion: &CameraMotion) {
        self.held = self.held.map(|held| motion.carry(&held, self.transport));
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        self.held = Some(*estimate);
        Update::Accepted(Solution::NONE)
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.held
    }

    fn reset(&mut self) {
        self.held = None;
    }

    fn name(&self) -> &'static str {
        "last-estimate"
    }
}

/// Largest difference of ln det Σ that counts as rounding.
// Open: equals of most-confident: §V-A. Differences of ln det Σ up to this value are rounding, and
// the newest estimate is returned.
const TIE: f64 = 1e-9;

/// Returns the estimate with the lowest uncertainty so far (§V-A): `most-confident`.
///
/// The uncertainty is det Σ, the squared volume of the uncertainty ellipsoid up to a factor. Unlike
/// the trace, it does not change with the camera's motion. If all covariances are multiples of one
/// matrix, as with the MVE, the smallest factor wins. The covariance of a motion makes older
/// estimates less certain than newer ones. Among equals, the newest is selected.
#[derive(Clone, Debug, Default)]
pub struct MostConfident(LastEstimate);

impl MostConfident {
    /// Creates the method.
    #[must_use]
    pub fn new(transport: Transport) -> Self {
        Self(LastEstimate::new(transport))
    }
}

impl Fuser for MostConfident {
    fn propagate(&mut self, motion: &CameraMotion) {
        self.0.propagate(motion);
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        let surer = |held: &PoseEstimate| {
            log_determinant(&held.covariance) < log_determinant(&estimate.covariance) - TIE
        };
        if !self.0.held.as_ref().is_some_and(surer) {
            self.0.update(estimate);
        }
        Update::Accepted(Solution::NONE)
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.0.estimate()
    }

    fn reset(&mut self) {
        self.0.reset();
    }

    fn name(&self) -> &'static str {
        "most-confident"
    }
}
