//! Stages that are guarded by a score.

use std::time::Duration;

use hicp_core::{Isometry3, Problem};
use hicp_score::Score;

use crate::observer::DecisionEvent;
use crate::outcome::{Outcome, Termination, Verdict};
use crate::session::Session;
use crate::stage::stage_trait::Stage;

/// Runs a stage and accepts its pose only if a score improves.
///
/// Otherwise it returns the initial pose, with [`Termination::ScoreNotImproved`]. With the MVE as
/// the score, a refinement never returns a pose that explains the image worse.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guard<S, C> {
    /// The guarded stage.
    pub stage: S,
    /// The score of a pose; lower is better.
    pub score: C,
}

impl<S: Stage, C: Score> Stage for Guard<S, C> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        if let Some(part) = self.score.unsupported(problem) {
            return Outcome::kept(init, Termination::Unsupported(part));
        }
        let outcome = self.stage.run(problem, init, session);
        if outcome.verdict != Verdict::Refined {
            return outcome;
        }
        let mut context = session.context(problem);
        let before = self.score.score(&mut context, init);
        let pose = &outcome.camera_from_object;
        let after = self.score.score(&mut context, pose);
        let kept = after < before;
        let event = DecisionEvent::new(self.name(), pose, after, before, kept);
        session.observer.on_decision(&event);
        if kept {
            outcome
        } else {
            let reason = match outcome.termination {
                Termination::Stopped => Termination::Stopped,
                _ => Termination::ScoreNotImproved,
            };
            Outcome {
                iterations: outcome.iterations,
                ..Outcome::kept(init, reason)
            }
        }
    }

    fn time_limit(&self) -> Option<Duration> {
        self.stage.time_limit()
    }

    fn name(&self) -> &'static str {
        "guard"
    }
}

/// Repeats a stage, each time from the previous result, and returns the pose with the best score.
///
/// The initial pose takes part. The loop ends early if the stage keeps its pose. On a tie the
/// earlier pose is returned, so a stage without an improvement does not move the pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeepBest<S, C> {
    /// Maximum number of passes.
    pub times: usize,
    /// The repeated stage.
    pub stage: S,
    /// The score of a pose; lower is better.
    pub score: C,
}

impl<S: Stage, C: Score> Stage for KeepBest<S, C> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        if let Some(part) = self.score.unsupported(problem) {
            return Outcome::kept(init, Termination::Unsupported(part));
        }
        let first = self.score.score(&mut session.context(problem), init);
        let mut best = (first, Outcome::kept(init, Termination::ScoreNotImproved));
        let mut last = Outcome::kept(init, Termination::Kept);
        for time in 0..self.times {
            let next = self.stage.run(problem, &last.camera_from_object, session);
            last = if time == 0 { next } else { last.then(next) };
            if last.verdict != Verdict::Refined {
                return last;
            }
            if next.verdict != Verdict::Refined {
                break;
            }
            let mut context = session.context(problem);
            let pose = &last.camera_from_object;
            let score = self.score.score(&mut context, pose);
            let kept = score < best.0;
            let event = DecisionEvent::new(self.name(), pose, score, best.0, kept);
            session.observer.on_decision(&event);
            if kept {
                best = (score, last);
            }
            if next.termination == Termination::Stopped {
                break;
            }
        }
        let best = Outcome {
            iterations: last.iterations,
            ..best.1
        };
        if last.termination == Termination::Stopped {
            best.ended_by(Termination::Stopped)
        } else {
            best
        }
    }

    fn time_limit(&self) -> Option<Duration> {
        self.stage.time_limit()
    }

    fn name(&self) -> &'static str {
        "keep-best"
    }
}
