//! A step along a trajectory, for callers that watch it.

use hicp_core::{Isometry3, Model};
use hybrid_icp::SequentialStep;

use crate::subject::Subject;

/// The result of a method for one image of a trajectory.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct TrajectoryStep<'a> {
    /// The object.
    pub object: &'a Subject,
    /// Index of the trajectory among those of its object.
    pub trajectory: u64,
    /// The true pose in the frame of this image. If the object has symmetries, it is one of
    /// several.
    pub camera_from_object: Isometry3<f64>,
    /// The registered model: a reconstruction.
    pub believed: &'a Model,
    /// The result.
    pub step: &'a SequentialStep,
}

impl TrajectoryStep<'_> {
    /// Returns the true pose that is nearest to a pose, among all that the symmetries allow.
    #[must_use]
    pub fn nearest_truth(&self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        nearest_truth(&self.object.model, &self.camera_from_object, pose)
    }
}

/// Returns the true pose that is nearest to a pose, among all that the symmetries allow.
pub(super) fn nearest_truth(
    model: &Model,
    truth: &Isometry3<f64>,
    pose: &Isometry3<f64>,
) -> Isometry3<f64> {
    let (center, radius) = (model.center(), model.radius());
    let symmetries = model.symmetries();
    symmetries.nearest_equivalent(truth, pose, &center, radius)
}
