//! Stages at a lower image resolution.

use std::time::Duration;

use hicp_core::{Isometry3, Problem};

use crate::outcome::Outcome;
use crate::session::Session;
use crate::stage::stage_trait::Stage;

/// Runs a stage on every `factor`-th pixel of the observation.
///
/// The coarse camera is phase-aligned with the fine one, so the pose needs no conversion.
/// Coarse-to-fine is a cascade: `Cascade((AtResolution { factor: 4, stage }, AtResolution { factor:
/// 2, stage }, stage))`. The coarse observation is built once per observation and shared.
///
/// A spacing that adapts to a number of points (`Stride::AboutPoints`, the default of selections
/// and associations) gives a coarse stage about as many points as a fine one. To have fewer, use
/// the same `Stride::Pixels` in all of them. If a side of the problem is a cloud, the stage runs
/// unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtResolution<S> {
    /// The distance between used pixels; 0 and 1 are the full resolution.
    pub factor: u32,
    /// The stage to run.
    pub stage: S,
}

impl<S: Stage> Stage for AtResolution<S> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let Some((model, observation)) = problem.sides().filter(|_| self.factor > 1) else {
            return self.stage.run(problem, init, session);
        };
        let coarse = observation.decimated(self.factor);
        self.stage.run(&Problem::new(model, &coarse), init, session)
    }

    fn time_limit(&self) -> Option<Duration> {
        self.stage.time_limit()
    }

    fn name(&self) -> &'static str {
        "at-resolution"
    }
}
