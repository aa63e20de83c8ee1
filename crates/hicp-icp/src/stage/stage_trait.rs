//! The trait of stages: the one verb, closed under composition.

use hicp_core::{Isometry3, Problem};

use crate::outcome::Outcome;
use crate::session::Session;

/// Makes a better pose from a pose.
///
/// [`crate::Icp`], [`crate::Cascade`], [`crate::Repeat`] and `Switch` are stages, and so is any composition of them:
/// Hybrid ICP is a struct literal.
///
/// # Contract
///
/// - Never fails and never panics on data: the [`Outcome`] says how it ended, and its pose is finite when `init` is.
/// - The returned pose was evaluated, or is `init` bit for bit.
/// - Pure: equal inputs give equal bits, whatever ran before; `&mut self` and the session's workspace are scratch.
/// - A warm run (the same stage and workspace before, on inputs no larger) makes no heap allocation.
pub trait Stage {
    /// Runs the stage from `init`, the initial `camera_from_object`.
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome;
}

impl<T: Stage + ?Sized> Stage for Box<T> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        (**self).run(problem, init, session)
    }
}
