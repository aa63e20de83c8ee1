//! The poses that look like the best one found.

use hicp_core::{Context, Isometry3};
use hicp_score::Score;

use crate::alternative::Alternative;
use crate::stage::search::distinct::Distinct;
use crate::stage::search::found::Found;
use crate::stage::search::near_symmetries::NearSymmetries;
use crate::stage::search::run::Run;
use crate::stage::search::shortlist::Shortlist;

/// Largest number of look-alikes that are scored to count them.
const SCORED: usize = 4;
/// Largest number of look-alikes that are refined.
const REFINED: usize = 8;
/// The same for a good pose.
const ALIKE_OF_GOOD: usize = 2;
/// Gap in score up to which a pose looks like a good one before it is refined.
const MAX_GAP: f64 = 0.05;

/// Poses at which the model nearly covers the best pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LookAlikes {
    ranked: Shortlist,
    listed: Shortlist,
}

impl LookAlikes {
    /// Lists the poses that look like `best` and may explain the image better or as well.
    ///
    /// If `best` is `bad`, all that rank better are listed.
    pub(crate) fn list(
        &mut self,
        run: &mut Run<'_, '_>,
        (best, bad): (&Found, bool),
        (ranking, score): (&mut impl Score, &mut impl Score),
    ) -> &Shortlist {
        self.ranked.clear();
        self.listed.clear();
        let Some((model, observation)) = run.problem.sides() else {
            return &self.listed;
        };
        let near = NearSymmetries::of(model);
        if near.is_empty() {
            return &self.listed;
        }
        let base = &best.outcome.camera_from_object;
        let gap = if bad { f64::INFINITY } else { MAX_GAP };
        let limit = run.score(ranking, base) + gap;
        let spacing = run.options.spacing_degrees;
        // Ranks are too rough to drop a look-alike of a good pose for a neighbor.
        let ranked_spacing = if bad { spacing } else { 0.0 };
        let refined = run.options.refined.min(REFINED);
        for index in near.undecided(observation, base, model.diameter()) {
            if run.is_over() {
                return &self.listed;
            }
            let pose = base * near.motion(index);
            if run.allows(&pose) {
                let score = run.score(ranking, &pose);
                if score < limit {
                    self.ranked.insert(score, pose, refined, ranked_spacing);
                }
            }
        }
        for (ranked, pose) in self.ranked.poses() {
            // The score decides which look-alikes of a good pose are worth refining.
            let (score, count) = if bad {
                (*ranked, usize::MAX)
            } else {
                (run.score(score, pose), ALIKE_OF_GOOD)
            };
            if score < best.score + gap {
                self.listed
                    .insert(score, *pose, refined.min(count), spacing);
            }
        }
        &self.listed
    }
}

/// Returns whether the image decides between `pose` and all poses that look like it.
pub(crate) fn is_unique(run: &Run<'_, '_>, pose: &Isometry3<f64>) -> bool {
    let Some((model, observation)) = run.problem.sides() else {
        return true;
    };
    let near = NearSymmetries::of(model);
    let mut undecided = near.undecided(observation, pose, model.diameter());
    undecided.next().is_none()
}

/// Returns the pose nearest to the initial one, by its rotation, among those that look like `pose`
/// and are apart from it.
///
/// Returns `None` if none of them is nearer than `pose`.
pub(crate) fn nearest_to_initial(
    run: &Run<'_, '_>,
    pose: &Isometry3<f64>,
) -> Option<Isometry3<f64>> {
    let (model, observation) = run.problem.sides()?;
    let near = NearSymmetries::of(model);
    let degrees = |pose: &Isometry3<f64>| run.distinct.degrees(run.init, pose);
    let undecided = near.undecided(observation, pose, model.diameter());
    let nearest = undecided
        .map(|index| pose * near.motion(index))
        .filter(|other| run.distinct.apart(other, pose))
        .min_by(|a, b| degrees(a).total_cmp(&degrees(b)))?;
    (degrees(&nearest) < degrees(pose)).then_some(nearest)
}

/// Estimates the number of poses that look like a given one and explain the image as well.
///
/// Two poses look alike if the model at one nearly covers the model at the other. An example is a
/// mug that is rotated around its axis while its handle is hidden. At most four look-alikes count.
/// Each adds exp(−g / 0.01), where g is its score minus that of the given pose, at most 2. Poses
/// within an MSSD of a tenth of the diameter, up to declared symmetries, do not count.
///
/// ```
/// use hicp_icp::LookAlikeCount;
/// use hicp_score::{MeanVsd, SampledMve};
/// let count = LookAlikeCount::new(SampledMve::imperfect_mask(), MeanVsd::imperfect_mask());
/// # let _ = count;
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct LookAlikeCount<R, C> {
    /// Ranks poses; lower is better.
    pub ranking: R,
    /// Compares poses; lower is better.
    pub score: C,
    ranked: Shortlist,
}

impl<R: Score, C: Score> LookAlikeCount<R, C> {
    /// Creates the counter from a cheap score that ranks, and a score that compares.
    #[must_use]
    pub fn new(ranking: R, score: C) -> Self {
        Self {
            ranking,
            score,
            ranked: Shortlist::default(),
        }
    }

    /// Returns the count at a pose, `camera_from_object`; 0 without a model or an image.
    ///
    /// Cost: a projection of 256 points. If the image does not decide among look-alikes, also one
    /// ranking score for each (at most 143), and the score of five poses. The near symmetries of a
    /// model are found once, in some 20 ms.
    pub fn at(&mut self, context: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
        if self.list(context, camera_from_object, 0.0).is_empty() {
            return 0.0;
        }
        let Some(model) = context.problem.model() else {
            return 0.0;
        };
        let distinct = Distinct::of(model);
        let own = self.score.score(context, camera_from_object);
        let others = self.ranked.poses().iter();
        others
            .filter(|(_, pose)| distinct.apart(camera_from_object, pose))
            .map(|(_, pose)| Alternative::likelihood_of(self.score.score(context, pose) - own))
            .sum()
    }

    /// Lists the best four poses that look like a given one, with their ranking scores.
    ///
    /// They may explain the image as well, and their rotations differ by `spacing_degrees` or more.
    /// Cost: that of [`LookAlikeCount::at`] without the scores of five poses.
    pub fn list(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        spacing_degrees: f64,
    ) -> &[(f64, Isometry3<f64>)] {
        self.ranked.clear();
        let Some((model, observation)) = context.problem.sides() else {
            return self.ranked.poses();
        };
        let near = NearSymmetries::of(model);
        let mut undecided = near
            .undecided(observation, camera_from_object, model.diameter())
            .peekable();
        if undecided.peek().is_none() {
            return self.ranked.poses();
        }
        let limit = self.ranking.score(context, camera_from_object) + MAX_GAP;
        for index in undecided {
            let pose = camera_from_object * near.motion(index);
            let score = self.ranking.score(context, &pose);
            if score < limit {
                self.ranked.insert(score, pose, SCORED, spacing_degrees);
            }
        }
        self.ranked.poses()
    }
}
