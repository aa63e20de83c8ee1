//! A search in progress.

use std::sync::Arc;
use std::time::{Duration, Instant};

use hicp_core::{Isometry3, Problem};
use hicp_score::Score;

use crate::observer::DecisionEvent;
use crate::outcome::{Outcome, Termination};
use crate::session::Session;
use crate::stage::search::distinct::Distinct;
use crate::stage::search::options::{SearchOptions, Start};
use crate::stage::stage_trait::Stage;

/// The inputs of a search, and what it has spent.
pub(crate) struct Run<'a, 's> {
    pub(crate) problem: &'a Problem<'a>,
    pub(crate) init: &'a Isometry3<f64>,
    pub(crate) options: SearchOptions,
    pub(crate) distinct: Arc<Distinct>,
    pub(crate) clock: Clock,
    pub(crate) session: &'a mut Session<'s>,
    pub(crate) iterations: usize,
    /// `true` if the observer requested the end.
    pub(crate) stopped: bool,
}

impl Run<'_, '_> {
    /// Scores a pose.
    pub(crate) fn score(&mut self, score: &mut impl Score, pose: &Isometry3<f64>) -> f64 {
        score.score(&mut self.session.context(self.problem), pose)
    }

    /// Runs a stage and counts its iterations.
    pub(crate) fn refine(&mut self, stage: &mut impl Stage, start: &Isometry3<f64>) -> Outcome {
        let outcome = stage.run(self.problem, start, self.session);
        self.iterations += outcome.iterations;
        self.stopped |= outcome.termination == Termination::Stopped;
        outcome
    }

    /// Reports a pose, and the score of the best one before it, to the observer.
    pub(crate) fn report(&mut self, pose: &Isometry3<f64>, (score, best): (f64, f64), kept: bool) {
        let event = DecisionEvent::new("hypothesis-search", pose, score, best, kept);
        self.session.observer.on_decision(&event);
    }

    /// Returns whether a pose lies within the bound.
    pub(crate) fn allows(&self, pose: &Isometry3<f64>) -> bool {
        let bound = self.options.bound;
        bound.is_none_or(|bound| bound.contains(self.problem, self.init, pose))
    }

    /// Returns whether the observer or the time limit ends the search.
    pub(crate) fn is_over(&self) -> bool {
        self.stopped || self.clock.is_over()
    }

    /// Returns whether a step of the search ends after `n` poses.
    ///
    /// Without an initial pose, the time limit lets one pass, so that there is a pose to return.
    pub(crate) fn is_over_after(&self, n: usize) -> bool {
        self.is_over() && (self.stopped || n > 0 || self.options.start == Start::Refined)
    }
}

/// The deadline of a run.
pub(crate) struct Clock(Option<(Instant, Duration)>);

impl Clock {
    pub(crate) fn start(limit: Option<Duration>) -> Self {
        Self(limit.map(|limit| (Instant::now(), limit)))
    }

    pub(crate) fn is_over(&self) -> bool {
        self.0
            .is_some_and(|(begun, limit)| begun.elapsed() >= limit)
    }
}
