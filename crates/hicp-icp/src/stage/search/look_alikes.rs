//! The poses that look like the best one found.

use hicp_score::Score;

use crate::stage::search::found::Found;
use crate::stage::search::near_symmetries::NearSymmetries;
use crate::stage::search::options::SearchOptions;
use crate::stage::search::run::Run;
use crate::stage::search::shortlist::Shortlist;

/// Number of refined poses that look like a good pose.
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
        options: &SearchOptions,
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
        let spacing = options.spacing_degrees;
        let refined = options.refined.div_ceil(3);
        for index in near.undecided(observation, base, model.diameter()) {
            if run.is_over() {
                return &self.listed;
            }
            let pose = base * near.motion(index);
            if run.allows(&pose) {
                let score = run.score(ranking, &pose);
                if score < limit {
                    self.ranked.insert(score, pose, refined, spacing);
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
