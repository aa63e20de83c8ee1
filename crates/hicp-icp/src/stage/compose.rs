//! Stages made of stages.

use std::time::Duration;

use hicp_core::internal::for_tuples;
use hicp_core::{Isometry3, Problem};

use crate::outcome::{Outcome, Termination, Verdict};
use crate::session::Session;
use crate::stage::stage_trait::Stage;

/// Runs stages in sequence, each from the result of the one before (Cascading ICP, §IV-B).
///
/// A stage that diverges returns the pose that it accepted last, and the next stage starts there.
/// If the first stage diverges in its first step, the second starts from the initial pose. If it
/// diverges later, the second starts from the last pose before the divergence. After a stage that
/// the observer stopped, no other one runs. Losses are never compared across stages.
///
/// The stages can read the initial pose of the cascade ([`Session::cascade_init`]):
/// `SelectAt::Cascade` selects there. In a cascade inside of another, this is the initial pose of
/// the inner one.
///
/// The paper's cascade is `Cascade((point_to_point, point_to_plane))`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cascade<S>(pub S);

macro_rules! cascade {
    ($first:ident $(, $next:ident)*) => {
        impl<$first: Stage, $($next: Stage),*> Stage for Cascade<($first, $($next,)*)> {
            #[allow(non_snake_case)]
            fn run(
                &mut self,
                problem: &Problem<'_>,
                init: &Isometry3<f64>,
                session: &mut Session<'_>,
            ) -> Outcome {
                let ($first, $($next,)*) = &mut self.0;
                let outer = session.cascade_init.replace(*init);
                let outcome = $first.run(problem, init, session);
                $(
                    let outcome = match outcome.termination {
                        Termination::Stopped => outcome,
                        _ => outcome.then($next.run(problem, &outcome.camera_from_object, session)),
                    };
                )*
                session.cascade_init = outer;
                outcome
            }

            fn name(&self) -> &'static str {
                "cascade"
            }
        }
    };
}
for_tuples!(cascade);

/// A cascade without stages keeps the initial pose, for a branch of a switch.
impl Stage for Cascade<()> {
    fn run(
        &mut self,
        _problem: &Problem<'_>,
        init: &Isometry3<f64>,
        _session: &mut Session<'_>,
    ) -> Outcome {
        Outcome::kept(init, Termination::Kept)
    }

    fn name(&self) -> &'static str {
        "cascade"
    }
}

/// A cascade of any number of stages of one type, as read from a file.
///
/// An empty one keeps the initial pose.
impl<T: Stage> Stage for Cascade<Vec<T>> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let outer = session.cascade_init.replace(*init);
        let mut outcome: Option<Outcome> = None;
        for stage in &mut self.0 {
            let start = outcome.map_or(*init, |o| o.camera_from_object);
            let next = stage.run(problem, &start, session);
            outcome = Some(outcome.map_or(next, |o| o.then(next)));
            if next.termination == Termination::Stopped {
                break;
            }
        }
        session.cascade_init = outer;
        outcome.unwrap_or_else(|| Outcome::kept(init, Termination::Kept))
    }

    fn name(&self) -> &'static str {
        "cascade"
    }
}

/// Repeats a stage, each time from the previous result: the outer iterations of Hybrid ICP (§IV-C).
///
/// A stage is pure, so after a pass that kept its initial pose the loop ends: further passes would
/// be identical. With 0 passes, it keeps the initial pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Repeat<S> {
    /// Maximum number of passes.
    pub times: usize,
    /// The repeated stage.
    pub stage: S,
}

impl<S: Stage> Stage for Repeat<S> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let mut outcome: Option<Outcome> = None;
        for _ in 0..self.times {
            let start = outcome.map_or(*init, |o| o.camera_from_object);
            let next = self.stage.run(problem, &start, session);
            outcome = Some(outcome.map_or(next, |o| o.then(next)));
            if next.verdict != Verdict::Refined || next.termination == Termination::Stopped {
                break;
            }
        }
        outcome.unwrap_or_else(|| Outcome::kept(init, Termination::Kept))
    }

    fn time_limit(&self) -> Option<Duration> {
        self.stage.time_limit()
    }

    fn name(&self) -> &'static str {
        "repeat"
    }
}
