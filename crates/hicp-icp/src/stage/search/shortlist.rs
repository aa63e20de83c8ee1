//! The best of many scored poses, at a distance from each other.

use std::cmp::Ordering;

use hicp_core::Isometry3;

/// The largest number of listed poses.
const MAX_LENGTH: usize = 10_000;

/// Poses with the lowest scores, best first, whose rotations differ.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Shortlist {
    poses: Vec<(f64, Isometry3<f64>)>,
}

impl Shortlist {
    /// Removes all poses.
    pub(crate) fn clear(&mut self) {
        self.poses.clear();
    }

    /// Returns the scores and poses, best first.
    pub(crate) fn poses(&self) -> &[(f64, Isometry3<f64>)] {
        &self.poses
    }

    /// Adds a pose, out of order until [`Self::keep_best`].
    ///
    /// Cheaper than [`Self::insert`] for a long list. Poses beyond `limit` leave it now and then.
    pub(crate) fn push(&mut self, score: f64, pose: Isometry3<f64>, limit: usize) {
        if self.poses.len() >= 2 * MAX_LENGTH {
            self.keep_best(limit);
        }
        self.poses.push((score, pose));
    }

    /// Sorts the poses, and keeps the best `limit` of different rotations.
    pub(crate) fn keep_best(&mut self, limit: usize) {
        let key = |pose: &Isometry3<f64>| pose.rotation.coords.data.0[0];
        self.poses.sort_unstable_by(|(score, pose), (other, next)| {
            let ties = key(pose).into_iter().zip(key(next));
            let ties = ties.map(|(a, b)| a.total_cmp(&b));
            score
                .total_cmp(other)
                .then_with(|| ties.fold(Ordering::Equal, Ordering::then))
        });
        self.poses
            .dedup_by(|(_, a), (_, b)| a.rotation == b.rotation);
        self.poses.truncate(limit.min(MAX_LENGTH));
    }

    /// Inserts a pose in order, unless a better one is too near or `limit` others are better.
    ///
    /// Poses that are too near and not better leave the list.
    pub(crate) fn insert(
        &mut self,
        score: f64,
        pose: Isometry3<f64>,
        limit: usize,
        spacing_degrees: f64,
    ) {
        let limit = limit.min(MAX_LENGTH);
        // One more, for the pose that is removed again.
        self.poses
            .reserve((limit + 1).saturating_sub(self.poses.len()));
        let place = self.poses.partition_point(|(other, _)| *other <= score);
        if place >= limit {
            return;
        }
        // The cosine of half the angle between two rotations.
        let limit_cosine = (0.5 * spacing_degrees.to_radians()).cos();
        let near = |other: &(f64, Isometry3<f64>)| {
            let cosine = other.1.rotation.coords.dot(&pose.rotation.coords).abs();
            other.1.rotation == pose.rotation || cosine > limit_cosine
        };
        if self.poses[..place].iter().any(near) {
            return;
        }
        let mut index = 0;
        self.poses.retain(|other| {
            index += 1;
            index <= place || !near(other)
        });
        self.poses.insert(place, (score, pose));
        self.poses.truncate(limit);
    }
}

#[cfg(test)]
mod tests {
    use hicp_core::Vector3;

    use super::*;

    /// Returns scores and angles of the listed poses, for poses rotated around one axis.
    fn listed(spacing_degrees: f64, poses: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let mut list = Shortlist::default();
        for (score, degrees) in poses {
            let pose = Isometry3::rotation(Vector3::z() * degrees.to_radians());
            list.insert(*score, pose, 3, spacing_degrees);
        }
        let turned = |pose: &Isometry3<f64>| pose.rotation.angle().to_degrees().round();
        list.poses()
            .iter()
            .map(|(score, pose)| (*score, turned(pose)))
            .collect()
    }

    #[test]
    fn duplicate_hypotheses_are_listed_once() {
        let neighbors = [(0.5, 0.0), (0.6, 5.0), (0.7, 90.0)];
        let both = [neighbors, neighbors].concat();
        assert_eq!(listed(0.0, &both), neighbors);
        assert_eq!(listed(20.0, &both), [(0.5, 0.0), (0.7, 90.0)]);
    }

    #[test]
    fn a_sorted_list_has_the_same_poses_as_insertions() {
        let angles = (0..40).map(|i| f64::from(i * 7 % 13) * 9.0);
        let poses: Vec<_> = angles.map(|angle| ((angle * 0.37).sin(), angle)).collect();
        let (mut pushed, mut inserted) = (Shortlist::default(), Shortlist::default());
        for (score, degrees) in poses {
            let pose = Isometry3::rotation(Vector3::z() * degrees.to_radians());
            pushed.push(score, pose, 5);
            inserted.insert(score, pose, 5, 0.0);
        }
        pushed.keep_best(5);
        assert_eq!(pushed, inserted);
    }

    #[test]
    fn of_two_near_hypotheses_the_better_stays() {
        let hypotheses = [
            (0.5, 0.0),
            (0.6, 50.0),
            (0.4, 10.0),
            (0.45, 100.0),
            (0.3, 150.0),
        ];
        assert_eq!(
            listed(20.0, &hypotheses),
            [(0.3, 150.0), (0.4, 10.0), (0.45, 100.0)]
        );
        assert_eq!(
            listed(20.0, &[(0.5, 0.0), (0.6, 15.0), (0.4, 30.0)]),
            [(0.4, 30.0), (0.5, 0.0)]
        );
    }
}
