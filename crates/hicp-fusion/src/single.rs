//! Methods that fuse nothing but choose: `last-estimate` and `most-confident`.

use crate::estimate::{PoseEstimate, log_determinant};
use crate::fuser::{Fuser, Update};
use crate::fusion::Solution;
use crate::motion::{CameraMotion, Carrier, Transport};

/// Believes the latest estimate (§V-A): `last-estimate`.
#[derive(Clone, Debug, Default)]
pub struct LastEstimate {
    transport: Transport,
    held: Option<PoseEstimate>,
}

impl LastEstimate {
    /// Makes the method.
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
        if let Some(held) = &mut self.held {
            Carrier::new(motion, self.transport).estimate(held);
        }
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

/// Difference of ln det Σ that is rounding.
const TIE: f64 = 1e-9;

/// Believes the estimate with the lowest uncertainty so far (§V-A): `most-confident`. The newest among equals.
///
/// Uncertainty is det Σ, the size of the ellipsoid: a camera motion does not change it, unlike the trace, and for multiples of one
/// matrix it orders as the factor does. Estimates that a motion of uncertain size has aged lose to fresher ones.
#[derive(Clone, Debug, Default)]
pub struct MostConfident {
    transport: Transport,
    held: Option<PoseEstimate>,
}

impl MostConfident {
    /// Makes the method.
    #[must_use]
    pub fn new(transport: Transport) -> Self {
        Self {
            transport,
            held: None,
        }
    }
}

impl Fuser for MostConfident {
    fn propagate(&mut self, motion: &CameraMotion) {
        if let Some(held) = &mut self.held {
            Carrier::new(motion, self.transport).estimate(held);
        }
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        let surer = |held: &PoseEstimate| {
            log_determinant(&held.covariance) < log_determinant(&estimate.covariance) - TIE
        };
        if !self.held.as_ref().is_some_and(surer) {
            self.held = Some(*estimate);
        }
        Update::Accepted(Solution::NONE)
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        self.held
    }

    fn reset(&mut self) {
        self.held = None;
    }

    fn name(&self) -> &'static str {
        "most-confident"
    }
}
