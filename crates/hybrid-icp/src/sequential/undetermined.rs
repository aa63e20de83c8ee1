//! The directions that no image of a static object determined.

use hicp_core::{Isometry3, Matrix6, Model, Problem, Translation3, Vector6, se3};
use hicp_icp::{Quality, Session, Stage, Workspace};
use hicp_metric::Degeneracy;
use hicp_score::Score;

use crate::extent::Extent;
use crate::presets::{Fit, fit_of};
use crate::registered::{Registered, camera_from_center, is_open};

/// The directions that no fused image of a static object determined.
///
/// The covariances of estimates do not keep them. Each image has an error of the tilt, which turns
/// the axis of an unknown rotation, so that the fused images seem to determine the rotation.
pub(crate) struct Undetermined {
    extent: Extent,
    /// Finds the information of an image at a pose, which it keeps.
    probe: Fit,
    /// The directions that no fused image determined; `None` without such an image.
    ///
    /// They are displacements in the object's frame that move the surface by 1 m.
    fused: Option<Vec<Vector6<f64>>>,
    /// The directions that the latest image does not determine.
    latest: Vec<Vector6<f64>>,
    /// Those of `fused` that the latest image does not determine either.
    left: Vec<Vector6<f64>>,
}

impl Undetermined {
    pub(crate) fn new(model: &Model) -> Self {
        let mut probe = fit_of(1);
        probe.metric.policy = Degeneracy::Ignore;
        Self {
            extent: Extent::new(model),
            probe,
            fused: None,
            latest: Vec::new(),
            left: Vec::new(),
        }
    }

    /// Forgets all images.
    pub(crate) fn clear(&mut self) {
        self.fused = None;
    }

    /// Judges an image at a pose, and returns the quality of its fit.
    ///
    /// `mve` is the score of the pose. Metrics differ in the directions that they seem to
    /// determine, so this does not depend on that of the registration.
    pub(crate) fn see(
        &mut self,
        problem: &Problem<'_>,
        pose: &Isometry3<f64>,
        mve: f64,
        (score, workspace): (&mut dyn Score, &mut Workspace),
    ) -> Option<Quality> {
        let quality = {
            let mut unwatched = ();
            let mut session = Session::new(workspace, &mut unwatched);
            self.probe.run(problem, pose, &mut session).quality
        };
        let information = quality.and_then(|quality| quality.information());
        let mut registered = Registered::new(&information.unwrap_or_default(), &self.extent, pose);
        let mut score = |pose: &_| score.score(&mut workspace.context(problem), pose);
        let mut open = registered.forget_open(&self.extent, pose, mve, &mut score);
        // Around a declared axis, all rotations are the same pose.
        let scale = self.extent.scale(pose);
        open.retain(|direction| (scale * direction).norm() > 0.1);
        let (back, turn) = (rotated(&pose.inverse()), rotated(pose));
        self.latest = open.iter().map(|direction| back * direction).collect();
        self.left = self.fused.clone().unwrap_or_default();
        self.left
            .retain(|direction| is_open(&(turn * direction), &self.extent, pose, mve, &mut score));
        quality
    }

    /// Returns the covariance in the directions that the latest image does not determine.
    pub(crate) fn of_latest(&self, pose: &Isometry3<f64>) -> Matrix6<f64> {
        self.covariance(pose, &self.latest)
    }

    /// Counts the latest image as fused. With `restarted`, it is the only one.
    pub(crate) fn fuse(&mut self, restarted: bool) {
        let [latest, left] = [&mut self.latest, &mut self.left].map(std::mem::take);
        let first = restarted || self.fused.is_none();
        self.fused = Some(if first { latest } else { left });
    }

    /// Returns the covariance in the directions that no fused image determined.
    pub(crate) fn of_fused(&self, pose: &Isometry3<f64>) -> Matrix6<f64> {
        self.covariance(pose, self.fused.as_deref().unwrap_or_default())
    }

    /// Returns the covariance of unknown displacements, whose deviation is the object's radius.
    fn covariance(&self, pose: &Isometry3<f64>, directions: &[Vector6<f64>]) -> Matrix6<f64> {
        let change = camera_from_center(&self.extent, pose) * rotated(pose) * self.extent.radius;
        let twists = directions.iter().map(|direction| change * direction);
        twists.map(|twist| twist * twist.transpose()).sum()
    }
}

/// Returns the map from displacements in the object's frame to those in the camera frame.
fn rotated(pose: &Isometry3<f64>) -> Matrix6<f64> {
    se3::adjoint(&Isometry3::from_parts(
        Translation3::identity(),
        pose.rotation,
    ))
}
