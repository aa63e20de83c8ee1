//! Stop rules on counts and time.

use std::time::{Duration, Instant};

use hicp_core::Iteration;

use crate::outcome::Termination;
use crate::stop::stop_rule::{Judgment, Progress, StopRule};

/// Ends a stage after a number of evaluations and accepts the last one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IterationLimit(pub usize);

impl Default for IterationLimit {
    /// 50; the divergence rules end nearly all stages long before.
    fn default() -> Self {
        // Open: max_iter: §III-A, Algorithm 1. Each stage has this limit. Limits from 10 to 200
        // give the same accuracy, because the rules of §IV-B.2 end nearly all stages before.
        Self(50)
    }
}

impl StopRule for IterationLimit {
    fn check(&mut self, iteration: &Iteration<'_>, _progress: &Progress<'_>) -> Judgment {
        Judgment::accept_if(iteration.index + 1 >= self.0, Termination::IterationLimit)
    }

    fn name(&self) -> &'static str {
        "iteration-limit"
    }
}

/// Ends a stage after a time and accepts the last evaluated pose.
///
/// Its results depend on the clock: two runs may differ.
#[derive(Clone, Copy, Debug)]
pub struct TimeLimit {
    /// The longest time of the stage.
    pub limit: Duration,
    started: Option<Instant>,
}

impl TimeLimit {
    /// Creates the rule. The clock starts with every run of the stage.
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

    fn check(&mut self, _iteration: &Iteration<'_>, _progress: &Progress<'_>) -> Judgment {
        let started = *self.started.get_or_insert_with(Instant::now);
        Judgment::accept_if(started.elapsed() >= self.limit, Termination::Deadline)
    }

    fn name(&self) -> &'static str {
        "time-limit"
    }
}

/// Ends a stage at a fixed instant, so that a whole pipeline can share one deadline.
///
/// The last evaluated pose is accepted. A stage that starts later evaluates its initial pose once
/// and returns it. Results depend on the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deadline(pub Instant);

impl StopRule for Deadline {
    fn check(&mut self, _iteration: &Iteration<'_>, _progress: &Progress<'_>) -> Judgment {
        Judgment::accept_if(Instant::now() >= self.0, Termination::Deadline)
    }

    fn name(&self) -> &'static str {
        "deadline"
    }
}
