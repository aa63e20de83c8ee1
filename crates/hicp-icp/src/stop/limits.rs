//! Stop rules on loss and time.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use crate::outcome::Termination;
use crate::stop::stop_rule::{Progress, StopRule};

/// Ends a stage as converged when the mean loss changes by less than an absolute amount, or has fallen below one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AbsoluteLoss {
    /// Change against the previous iteration, m².
    pub change: f64,
    /// Loss that is good enough, m².
    pub good_enough: f64,
}

impl Default for AbsoluteLoss {
    /// The squares of a micrometre and of ten micrometres.
    fn default() -> Self {
        Self {
            change: 1e-12,
            good_enough: 1e-10,
        }
    }
}

impl StopRule for AbsoluteLoss {
    fn check(&mut self, progress: &Progress<'_>) -> ControlFlow<Termination> {
        let now = progress.current.mean_loss;
        let settled = progress
            .previous
            .is_some_and(|previous| (previous.mean_loss - now).abs() < self.change);
        if settled || now < self.good_enough {
            ControlFlow::Break(Termination::Converged)
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// Ends a stage when it has run for a time; the last evaluated pose is returned.
///
/// The one rule whose results depend on the clock: two runs may differ.
#[derive(Clone, Copy, Debug)]
pub struct TimeLimit {
    /// How long the stage may run.
    pub limit: Duration,
    started: Option<Instant>,
}

impl TimeLimit {
    /// Makes the rule. The clock starts with every stage run.
    #[must_use]
    pub fn new(limit: Duration) -> Self {
        Self {
            limit,
            started: None,
        }
    }
}

impl StopRule for TimeLimit {
    fn start(&mut self) {
        self.started = Some(Instant::now());
    }

    fn check(&mut self, _progress: &Progress<'_>) -> ControlFlow<Termination> {
        let started = *self.started.get_or_insert_with(Instant::now);
        if started.elapsed() >= self.limit {
            ControlFlow::Break(Termination::Deadline)
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// Ends every stage that is still running at a moment: one deadline for a whole pipeline.
///
/// Stages that begin after it evaluate their initial pose once and return it. Results depend on the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deadline(pub Instant);

impl StopRule for Deadline {
    fn check(&mut self, _progress: &Progress<'_>) -> ControlFlow<Termination> {
        if Instant::now() >= self.0 {
            ControlFlow::Break(Termination::Deadline)
        } else {
            ControlFlow::Continue(())
        }
    }
}
