//! The distinct poses that a search found.

use hicp_core::Isometry3;

use crate::alternative::Alternative;
use crate::outcome::{Outcome, Termination};
use crate::stage::search::distinct::Distinct;

/// The state of a pose in a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Progress {
    /// Explored at low cost, or a look-alike as it is.
    Explored,
    /// Fitted by the finishing stage.
    Fitted,
    /// Refined by the local stage.
    Refined,
}

/// A pose with its score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    pub(crate) score: f64,
    pub(crate) outcome: Outcome,
    /// The doubt, once it is known.
    pub(crate) doubt: Option<f64>,
    pub(crate) progress: Progress,
}

/// The score that outweighs a doubt of 1.
const DOUBT_WEIGHT: f64 = 0.1;
/// The doubt up to which a pose needs no gain but a clearly lower score.
const CERTAIN: f64 = 0.02;
/// The difference of a clearly lower score.
pub(crate) const CLEAR: f64 = 0.01;
/// The doubt in every pose: of those without doubt, some percent are wrong.
pub(crate) const LEAST_DOUBT: f64 = 0.05;

impl Found {
    /// Creates an explored pose, or a look-alike as it is, whose doubt is not known.
    pub(crate) fn explored(score: f64, camera_from_object: Isometry3<f64>) -> Self {
        Self {
            score,
            outcome: Outcome::refined(camera_from_object, Termination::Converged),
            doubt: None,
            progress: Progress::Explored,
        }
    }

    /// Returns the doubt; 1 if it is not known.
    pub(crate) fn doubt(&self) -> f64 {
        self.doubt.unwrap_or(1.0)
    }

    /// Returns the score plus a part of the doubt.
    ///
    /// Errors of the sensor shift the scores of poses that explain the same pixels. The doubt also
    /// depends on where the errors are.
    pub(crate) fn cost(&self) -> f64 {
        self.score + DOUBT_WEIGHT * self.doubt()
    }

    /// Returns whether the cost is lower by a gain, and neither score nor doubt is higher.
    ///
    /// A doubt up to [`LEAST_DOUBT`] never counts as higher. Neither does one up to a half if the
    /// score is half as high: a pose that explains little can be without doubt, by mistake.
    pub(crate) fn beats(&self, other: &Self, gain: f64) -> bool {
        let explains = 2.0 * self.score < other.score;
        let limit = if explains { 0.5 } else { LEAST_DOUBT };
        let worse = self.score > other.score || self.doubt() > other.doubt().max(limit);
        !worse && self.cost() < other.cost() - gain
    }
}

/// Distinct poses, best first.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct FoundPoses {
    poses: Vec<Found>,
}

impl FoundPoses {
    /// Removes all poses.
    pub(crate) fn clear(&mut self) {
        self.poses.clear();
    }

    /// Returns the pose with the lowest score.
    pub(crate) fn best(&mut self) -> Option<&mut Found> {
        self.poses.first_mut()
    }

    /// Returns the pose with the lowest sum of the score and a part of the doubt.
    pub(crate) fn cheapest(&self) -> Option<Found> {
        let poses = self.poses.iter().copied();
        poses.min_by(|a, b| a.cost().total_cmp(&b.cost()))
    }

    /// Returns the pose with the lowest score, if it is certain that it is better than `other`.
    ///
    /// It then has nearly no doubt, and a score that is clearly lower than that of every pose
    /// found. The handle of a mug, for example, changes the score by only some percent.
    pub(crate) fn certain(&self, other: &Found) -> Option<Found> {
        let (best, rest) = self.poses.split_first()?;
        let mut rivals = rest.iter().chain([other]);
        let is_clear = rivals.all(|rival| best.score < rival.score - CLEAR);
        (is_clear && best.doubt() <= CERTAIN).then_some(*best)
    }

    /// Adds a pose and returns whether it stays. Of two poses that are not distinct, the one with
    /// the lower cost does.
    pub(crate) fn add(&mut self, found: Found, distinct: &Distinct) -> bool {
        let pose = found.outcome.camera_from_object;
        let same = |other: &Found| !distinct.apart(&other.outcome.camera_from_object, &pose);
        let better = |other: &Found| other.cost() <= found.cost() && same(other);
        if self.poses.iter().any(better) {
            return false;
        }
        self.poses.retain(|other| !same(other));
        let place = self
            .poses
            .partition_point(|other| other.score <= found.score);
        self.poses.insert(place, found);
        true
    }

    /// Removes the best pose that is not fitted, up to a gap to the best score.
    pub(crate) fn next_to_fit(&mut self, gap: f64) -> Option<Found> {
        let limit = self.poses.first()?.score + gap;
        let next = |found: &Found| found.progress == Progress::Explored && found.score <= limit;
        let next = self.poses.iter().position(next)?;
        Some(self.poses.remove(next))
    }

    /// Removes the cheapest pose that the local stage has not refined, up to a gap to the lowest
    /// cost.
    pub(crate) fn next_to_refine(&mut self, gap: f64) -> Option<Found> {
        let limit = self.cheapest()?.cost() + gap;
        let poses = self.poses.iter().enumerate();
        let (next, _) = poses
            .filter(|(_, found)| found.progress < Progress::Refined && found.cost() <= limit)
            .min_by(|(_, a), (_, b)| a.cost().total_cmp(&b.cost()))?;
        Some(self.poses.remove(next))
    }

    /// Lists the poses that differ from the returned one.
    pub(crate) fn list_alternatives(
        &self,
        returned: &Isometry3<f64>,
        score: f64,
        distinct: &Distinct,
        alternatives: &mut Vec<Alternative>,
    ) {
        alternatives.reserve(self.poses.len());
        for found in &self.poses {
            let other = found.outcome.camera_from_object;
            if distinct.apart(&other, returned) {
                alternatives.push(Alternative {
                    camera_from_object: other,
                    score: found.score,
                    gap: found.score - score,
                    color_gap: None,
                    mssd_meters: distinct.mssd(&other, returned),
                    rotation_degrees: distinct.degrees(&other, returned),
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(score: f64, doubt: f64) -> Found {
        Found {
            score,
            outcome: Outcome::kept(&Isometry3::identity(), Termination::Converged),
            doubt: Some(doubt),
            progress: Progress::Refined,
        }
    }

    #[test]
    fn a_pose_wins_by_a_gain_and_never_with_a_higher_score_or_doubt() {
        let local = found(0.3, 0.5);
        assert!(found(0.19, 0.5).beats(&local, 0.1));
        assert!(!found(0.21, 0.5).beats(&local, 0.1));
        // A tenth of the doubt counts.
        assert!(found(0.21, 0.3).beats(&local, 0.1));
        assert!(!found(0.1, 0.6).beats(&local, 0.1));
        assert!(!found(0.31, 0.0).beats(&local, 0.0));
        // A doubt is not exact to a few percent.
        assert!(found(0.1, 0.04).beats(&found(0.3, 0.01), 0.1));
        assert!(!found(0.16, 0.06).beats(&found(0.3, 0.01), 0.1));
        // Half of the score outweighs doubt, up to a half.
        assert!(found(0.14, 0.4).beats(&found(0.3, 0.01), 0.1));
        assert!(!found(0.01, 0.6).beats(&found(0.3, 0.01), 0.1));
        // An unknown doubt is the largest.
        let unknown = Found {
            doubt: None,
            ..found(0.0, 0.0)
        };
        assert!(!unknown.beats(&local, 0.1));
    }

    #[test]
    fn a_certain_pose_has_no_rival() {
        let local = found(0.05, 0.04);
        let among = |poses: Vec<Found>| FoundPoses { poses }.certain(&local);
        let best = found(0.02, 0.01);
        assert_eq!(among(vec![best, local]), Some(best));
        assert_eq!(among(vec![best, found(0.025, 0.5), local]), None);
        assert_eq!(among(vec![found(0.045, 0.01), local]), None);
        assert_eq!(among(vec![found(0.02, 0.03), local]), None);
        assert_eq!(among(vec![local]), None);
    }

    #[test]
    fn low_scores_are_fitted_first_and_low_costs_refined_first() {
        let with = |progress, found: Found| Found { progress, ..found };
        let mut found = FoundPoses {
            poses: vec![
                with(Progress::Fitted, found(0.1, 0.9)),
                with(Progress::Explored, found(0.12, 0.0)),
                with(Progress::Fitted, found(0.13, 0.1)),
                with(Progress::Refined, found(0.14, 0.0)),
            ],
        };
        let scores = |found: &FoundPoses| found.poses.iter().map(|f| f.score).collect::<Vec<_>>();
        // Nothing else is unfitted, and this one only within the gap.
        assert!(found.next_to_fit(0.01).is_none());
        assert!(found.next_to_fit(0.03).is_some());
        assert!(found.next_to_fit(1.0).is_none());
        assert_eq!(scores(&found), [0.1, 0.13, 0.14]);
        // The costs are 0.19, 0.14 and 0.14.
        assert!(found.next_to_refine(0.04).is_some());
        assert_eq!(scores(&found), [0.1, 0.14]);
        assert!(found.next_to_refine(0.04).is_none());
        assert!(found.next_to_refine(0.06).is_some());
        assert_eq!(scores(&found), [0.14]);
        assert!(found.next_to_refine(1.0).is_none());
    }
}
