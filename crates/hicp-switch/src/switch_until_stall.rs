//! The stage that switches until the score stalls.

use hicp_core::{Isometry3, Problem};
use hicp_icp::{DecisionEvent, Outcome, Regime, RegimeEvent, Session, Stage, Termination, Verdict};

use crate::switcher::Switcher;

/// Runs Dynamic Switching until the score stalls, and returns the best pose.
///
/// A step starts from the best pose so far. It runs the stage that the switcher selects there, as
/// in [`Switch`](crate::Switch). The score is that of the switcher, which is lower if a pose is
/// better. A step that lowers the score by less than `min_gain` is a stall. Then the other stage is
/// tried once. If that is a stall, too, no further steps follow. Nor do they if the score is at or
/// below `good_enough`, except for the first step.
///
/// **Contract**: the score of the returned pose is never above that of the initial one. Unless its
/// score is lower, the returned pose is the initial one, bit for bit. This includes a switcher
/// without a score.
///
/// Cost: a choice, and at most `max_steps` × (a stage and a choice).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwitchUntilStall<W, A, M> {
    /// Selects the regime of a pose, and scores it: a [`Threshold`](crate::Threshold) on the MVE.
    pub switcher: W,
    /// The stage for an estimate that agrees with the image.
    pub aligned: A,
    /// The stage for an estimate that does not agree with the image.
    pub misaligned: M,
    /// Maximum number of steps; 0 keeps the initial pose.
    pub max_steps: usize,
    /// The gain in score below which a step is a stall.
    pub min_gain: f64,
    /// The score at which no further steps follow.
    pub good_enough: f64,
}

impl<W: Switcher, A: Stage, M: Stage> Stage for SwitchUntilStall<W, A, M> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        if let Some(part) = self.switcher.unsupported(problem) {
            return Outcome::kept(init, Termination::Unsupported(part));
        }
        let name = self.name();
        let mut judge = |pose: &Isometry3<f64>, session: &mut Session<'_>| {
            self.switcher.regime(&mut session.context(problem), pose)
        };
        let score = |event: &RegimeEvent| event.score.unwrap_or(f64::MAX);
        let mut held = judge(init, session);
        let mut best = Outcome::kept(init, Termination::Kept);
        let mut iterations = 0;
        let mut other = false;
        for step in 0..self.max_steps {
            if step > 0 && score(&held) <= self.good_enough {
                break;
            }
            let regime = match held.regime {
                regime if !other => regime,
                Regime::ALIGNED => Regime::MISALIGNED,
                _ => Regime::ALIGNED,
            };
            session.observer.on_regime(&RegimeEvent { regime, ..held });
            let start = best.camera_from_object;
            let next = if regime == Regime::ALIGNED {
                self.aligned.run(problem, &start, session)
            } else {
                self.misaligned.run(problem, &start, session)
            };
            iterations += next.iterations;
            let found = match next.verdict {
                Verdict::Refined => judge(&next.camera_from_object, session),
                Verdict::KeptInitial(_) => held,
            };
            let gain = score(&held) - score(&found);
            if let (Verdict::Refined, Some(score)) = (next.verdict, found.score) {
                let (pose, kept) = (&next.camera_from_object, gain > 0.0);
                let best = held.score.unwrap_or(f64::INFINITY);
                let event = DecisionEvent::new(name, pose, score, best, kept);
                session.observer.on_decision(&event);
            }
            if gain > 0.0 {
                (held, best) = (found, best.then(next));
            } else if best.verdict != Verdict::Refined {
                best = match next.verdict {
                    Verdict::Refined => Outcome::kept(init, Termination::ScoreNotImproved),
                    Verdict::KeptInitial(_) => next,
                };
            }
            let stalled = gain < self.min_gain;
            if next.termination == Termination::Stopped {
                best = best.ended_by(Termination::Stopped);
                break;
            }
            if stalled && other {
                break;
            }
            other = stalled;
        }
        best.iterations = iterations;
        best
    }

    fn name(&self) -> &'static str {
        "alternate"
    }
}
