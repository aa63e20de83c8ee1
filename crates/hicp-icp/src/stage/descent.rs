//! Descent on a score.

use hicp_core::{Isometry3, Point3, Problem, Translation3, UnitQuaternion, Vector3};
use hicp_score::Score;

use crate::outcome::{Outcome, Termination};
use crate::session::Session;
use crate::stage::stage_trait::Stage;

/// Moves a pose along and around the axes of the camera as long as a score falls.
///
/// It is a pattern search (Hooke & Jeeves 1961): every axis in turn, in both directions, with steps
/// that halve when no axis helps. Unlike ICP, it uses everything that the score uses: pixels that
/// the camera sees through, the border of the mask, and noisy pixels without their normals. It
/// costs far more per step, so it runs only if the score is above [`Descent::good_enough`].
///
/// It also keeps the initial pose if its score is 1 or more, because such a pose shows no
/// direction, or if the observation has no surface.
///
/// **Contract**: the score of the returned pose is never above that of the initial one.
///
/// Cost: at most `evaluations` scores, and one if the initial pose is good enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descent<C> {
    /// The score; lower is better.
    pub score: C,
    /// The score at or below which the initial pose is kept.
    pub good_enough: f64,
    /// First step, as a share of the model's diameter. The surface moves by about as much.
    pub first_step: f64,
    /// Smallest step, as a share of the model's diameter.
    pub last_step: f64,
    /// Smallest gain in score of a move.
    pub min_gain: f64,
    /// Largest number of scores.
    pub evaluations: usize,
}

impl<C: Default> Default for Descent<C> {
    /// Runs above a score of 0.2, with steps of 5 % and 2.5 % of the diameter. A move must gain
    /// 0.006, and at most 80 scores are spent.
    fn default() -> Self {
        Self {
            score: C::default(),
            good_enough: 0.2,
            first_step: 0.05,
            last_step: 0.025,
            min_gain: 0.006,
            evaluations: 80,
        }
    }
}

impl<C: Score> Stage for Descent<C> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        if let Some(part) = self.score.unsupported(problem) {
            return Outcome::kept(init, Termination::Unsupported(part));
        }
        let kept = Outcome::kept(init, Termination::ScoreNotImproved);
        let seen = problem.sides().filter(|(_, o)| o.has_surface());
        let Some((model, _)) = seen else {
            return kept;
        };
        let mut context = session.context(problem);
        let mut best = (self.score.score(&mut context, init), *init);
        // A pose that explains nothing, or is not finite, shows no direction.
        if best.0 <= self.good_enough || best.0 >= 1.0 {
            return kept;
        }
        let diameter = model.diameter();
        let mut spent = 1;
        let mut step = self.first_step;
        // The sign of the last success along each axis is tried first.
        let mut signs = [1.0; 6];
        'steps: while step >= self.last_step {
            let mut improved = false;
            for (axis, sign) in signs.iter_mut().enumerate() {
                for _ in 0..2 {
                    if spent >= self.evaluations {
                        break 'steps;
                    }
                    spent += 1;
                    let length = step * diameter * *sign;
                    let center = best.1 * model.center();
                    let pose = moved(&best.1, center, axis, length, diameter);
                    let score = self.score.score(&mut context, &pose);
                    if score < best.0 - self.min_gain {
                        best = (score, pose);
                        improved = true;
                        break;
                    }
                    *sign = -*sign;
                }
            }
            if !improved {
                step *= 0.5;
            }
        }
        if best.1 == *init {
            kept
        } else {
            Outcome::refined(best.1, Termination::Converged)
        }
    }

    fn name(&self) -> &'static str {
        "descent"
    }
}

/// Moves a pose by `length` meters along one of the axes (0 to 2), or rotates it around an axis
/// through `center` such that points at half the diameter move by that length.
fn moved(
    pose: &Isometry3<f64>,
    center: Point3<f64>,
    axis: usize,
    length: f64,
    diameter: f64,
) -> Isometry3<f64> {
    let mut direction = Vector3::zeros();
    direction[axis % 3] = 1.0;
    if axis < 3 {
        return Translation3::from(direction * length) * pose;
    }
    let turn = UnitQuaternion::from_scaled_axis(direction * (2.0 * length / diameter));
    Isometry3::rotation_wrt_point(turn, center) * pose
}
