//! The trait of fusers.

use hicp_core::internal::type_label;

use crate::estimate::PoseEstimate;
use crate::fusion::Solution;
use crate::motion::CameraMotion;

/// Turns the estimates that come in while the camera moves into one, in the current camera frame (§V).
///
/// # Contract
///
/// - [`Fuser::propagate`] takes everything held to the next camera frame; [`Fuser::update`] takes an estimate in the current
///   frame; [`Fuser::estimate`] returns what is believed there, `None` before the first update.
/// - After one update the estimate is that update's, covariance included, unless it was gated.
/// - Never panics and never returns what is not finite: estimates and motions are checked when they are made.
/// - Pure: equal calls since the last [`Fuser::reset`] give equal bits.
/// - A warm update (as many estimates held before, then reset) makes no heap allocation.
pub trait Fuser {
    /// Takes what is held to the next camera frame.
    fn propagate(&mut self, motion: &CameraMotion);

    /// Takes in an estimate in the current camera frame.
    fn update(&mut self, estimate: &PoseEstimate) -> Update;

    /// Returns the fused estimate in the current camera frame.
    fn estimate(&self) -> Option<PoseEstimate>;

    /// Forgets everything, keeps the memory.
    fn reset(&mut self);

    /// Name in traces and on the command line.
    fn name(&self) -> &'static str {
        type_label::<Self>()
    }
}

impl<T: Fuser + ?Sized> Fuser for Box<T> {
    fn propagate(&mut self, motion: &CameraMotion) {
        (**self).propagate(motion);
    }

    fn update(&mut self, estimate: &PoseEstimate) -> Update {
        (**self).update(estimate)
    }

    fn estimate(&self) -> Option<PoseEstimate> {
        (**self).estimate()
    }

    fn reset(&mut self) {
        (**self).reset();
    }

    fn name(&self) -> &'static str {
        (**self).name()
    }
}

/// What became of an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Update {
    /// It was taken in.
    Accepted(Solution),
    /// It failed the gate but stands until a better one comes, for there is nothing else.
    Provisional(Failure, Solution),
    /// It was left out.
    Rejected(Failure),
    /// It contradicted what was held, as those before it did: everything held was forgotten, and it starts anew.
    Restarted(Failure, Solution),
}

impl Update {
    /// How the fusion ended, where something was fused.
    #[must_use]
    pub fn solution(&self) -> Option<&Solution> {
        match self {
            Self::Accepted(solution)
            | Self::Provisional(_, solution)
            | Self::Restarted(_, solution) => Some(solution),
            Self::Rejected(_) => None,
        }
    }

    /// Returns whether the estimate is part of what is held now.
    #[must_use]
    pub fn is_taken(&self) -> bool {
        self.solution().is_some()
    }
}

/// Why an estimate failed a gate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// Its MVE says that it does not explain the image.
    Mve {
        /// The MVE.
        found: f64,
        /// The largest that passes.
        limit: f64,
    },
    /// It is too far from what is held, by both covariances.
    Mahalanobis {
        /// The squared distance.
        found: f64,
        /// The largest that passes.
        limit: f64,
    },
}
