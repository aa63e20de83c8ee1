//! The distinct poses that a search found.

use hicp_core::Isometry3;

use crate::alternative::Alternative;
use crate::outcome::Outcome;
use crate::stage::search::distinct::Distinct;

/// A refined pose with its score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    pub(crate) score: f64,
    pub(crate) outcome: Outcome,
    /// `true` if the local stage refined it.
    pub(crate) finished: bool,
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
    pub(crate) fn best(&self) -> Option<Found> {
        self.poses.first().copied()
    }

    /// Adds a pose. Of two poses that are not distinct, the one with the lower score stays.
    pub(crate) fn add(&mut self, found: Found, distinct: &Distinct) {
        let pose = found.outcome.camera_from_object;
        let same = |other: &Found| !distinct.apart(&other.outcome.camera_from_object, &pose);
        let place = self
            .poses
            .partition_point(|other| other.score <= found.score);
        if self.poses[..place].iter().any(same) {
            return;
        }
        self.poses
            .retain(|other| other.score <= found.score || !same(other));
        self.poses.insert(place, found);
    }

    /// Takes the best pose that the local stage has not refined, up to a gap to the best score.
    ///
    /// It is marked as refined.
    pub(crate) fn next(&mut self, gap: f64) -> Option<Outcome> {
        let best = self.best()?.score;
        let unfinished = |found: &&mut Found| !found.finished && found.score <= best + gap;
        let next = self.poses.iter_mut().find(unfinished)?;
        next.finished = true;
        Some(next.outcome)
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
