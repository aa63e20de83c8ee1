//! The stage that switches until the score stalls.

use hicp_core::{Isometry3, Problem};
use hicp_icp::{Outcome, Regime, RegimeEvent, Session, Stage, Termination, Verdict};
use hicp_score::Score;

/// Runs Dynamic Switching until the score stalls, and returns the best pose.
///
/// A step starts from the best pose so far. It runs `aligned` if the score of that pose is below
/// `alpha`, otherwise `misaligned`. A step that lowers the score by less than `min_gain` is a
/// stall. Then the other stage is tried once, and if that is a stall, too, the iteration ends. It
/// also ends if the score is at or below `good_enough`, but not before the first step.
///
/// **Contract**: the score of the returned pose is never above that of the initial one. Unless its
/// score is lower, the returned pose is the initial one, bit for bit.
///
/// Cost: a score, and at most `max_steps` × (a stage and a score).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SwitchUntilStall<C, A, M> {
    /// The score, lower is better: the MVE, as in [`Threshold`](crate::Threshold).
    pub score: C,
    /// The smallest score of a misaligned estimate.
    pub alpha: f64,
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

impl<C: Score, A: Stage, M: Stage> Stage for SwitchUntilStall<C, A, M> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        if let Some(part) = self.score.unsupported(problem) {
            return Outcome::kept(init, Termination::Unsupported(part));
        }
        let mut judge = |pose: &Isometry3<f64>, session: &mut Session<'_>| {
            let mut context = session.context(problem);
            self.score.score(&mut context, pose)
        };
        let mut score = judge(init, session);
        let mut best = Outcome::kept(init, Termination::IterationLimit);
        let mut iterations = 0;
        let mut other = false;
        for step in 0..self.max_steps {
            if step > 0 && score <= self.good_enough {
                break;
            }
            let aligned = (score < self.alpha) != other;
            session.observer.on_regime(&RegimeEvent {
                regime: if aligned {
                    Regime::ALIGNED
                } else {
                    Regime::MISALIGNED
                },
                score: Some(score),
            });
            let start = best.camera_from_object;
            let next = if aligned {
                self.aligned.run(problem, &start, session)
            } else {
                self.misaligned.run(problem, &start, session)
            };
            iterations += next.iterations;
            let found = match next.verdict {
                Verdict::Refined => judge(&next.camera_from_object, session),
                Verdict::KeptInitial(_) => score,
            };
            let gain = score - found;
            if gain > 0.0 {
                (score, best) = (found, best.then(next));
            } else if best.verdict != Verdict::Refined {
                best = match next.verdict {
                    Verdict::Refined => Outcome::kept(init, Termination::ScoreNotImproved),
                    Verdict::KeptInitial(_) => next,
                };
            }
            let stalled = gain < self.min_gain;
            if next.termination == Termination::Stopped || (stalled && other) {
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
