//! The best of many scored poses, at a distance from each other.

use hicp_core::Isometry3;

/// The largest number of listed poses: the list is kept in order.
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

    /// Inserts a pose, unless it is too near to a better one or not among the best `limit`.
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
