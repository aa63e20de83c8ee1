//! A registered pose, and what the image says about it.

use hicp_core::Isometry3;
use hicp_icp::Quality;
use hicp_score::Evidence;

/// A registered pose with its evidence.
///
/// The limits were chosen on simulated sequences of the tuning objects.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) pose: Isometry3<f64>,
    pub(super) quality: Option<Quality>,
    pub(super) evidence: Evidence,
}

impl Found {
    /// Returns the share of the visible pixels that contradict the pose.
    fn contradiction(&self) -> f64 {
        let against = self.evidence.contradicts();
        against / (self.evidence.agrees + against).max(1e-9)
    }

    /// Returns how well a pose fits, to compare poses in one image.
    pub(super) fn merit(&self) -> f64 {
        let e = &self.evidence;
        e.agrees - e.contradicts() - 0.5 * e.unexplained + 0.2 * e.contour
    }

    /// Returns whether the image shows the object at the pose, given that it was expected there.
    pub(super) fn explains(&self) -> bool {
        let e = &self.evidence;
        e.agrees > 0.15 && self.contradiction() < 0.2 && e.contour > 0.2 && e.unexplained < 0.5
    }

    /// Returns whether most of the object is hidden at the pose.
    pub(super) fn is_hidden(&self) -> bool {
        self.evidence.hidden > 0.7
    }

    /// Returns whether the pose is as good as a right one usually is.
    pub(super) fn is_sure(&self) -> bool {
        self.explains() && self.contradiction() < 0.1 && self.evidence.contour > 0.35
    }

    /// Returns whether no other pose needs to be tried.
    pub(super) fn is_clear(&self) -> bool {
        self.explains() && self.contradiction() < 0.03 && self.evidence.contour > 0.5
    }

    /// Returns whether the image shows the object at a pose where it was not expected.
    pub(super) fn stands_alone(&self) -> bool {
        let e = &self.evidence;
        e.agrees > 0.4 && self.contradiction() < 0.06 && e.contour > 0.7 && e.unexplained < 0.15
    }
}
