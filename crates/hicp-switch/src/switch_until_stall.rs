//! The stage that switches as long as it pays.

use hicp_core::{Isometry3, Problem};
use hicp_icp::{Outcome, Regime, RegimeEvent, Session, Stage, Termination, Verdict};
use hicp_score::Score;

/// Dynamic Switching until the score stalls, with the best pose met as the result.
///
/// A step starts from the best pose so far and runs `aligned` where its score is below `alpha`, else `misaligned`. A step that
/// lowers the score by less than `min_gain` is a stall: the other of the two is then tried once, and if it gains nothing either,
/// the stage ends. It ends at once where the score is at or below `good_enough`, but never before the first step.
///
/// **Contract**: the score of the returned pose is never above that of the initial one, and the pose is the initial one bit
/// for bit unless its score is lower. Cost: at most `max_steps` × (a stage and a score), and a score.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SwitchUntilStall<C, A, M> {
    /// The judge, lower is better; the MVE, as in [`crate::Threshold`].
    pub score: C,
    /// The score from which on an estimate counts as misaligned.
    pub alpha: f64,
    /// What runs when the estimate agrees with the image.
    pub aligned: A,
    /// What runs when it does not.
    pub misaligned: M,
    /// How many steps at most; 0 keeps the initial pose.
    pub max_steps: usize,
    /// The gain of the score below which a step is a stall.
    pub min_gain: f64,
    /// The score at which no further step is taken.
    pub good_enough: f64,
}

impl<C: Score, A: Stage, M: Stage> Stage for SwitchUntilStall<C, A, M> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let mut judge = |pose: &Isometry3<f64>, session: &mut Session<'_>| {
            let mut context = session.workspace.context(problem);
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
