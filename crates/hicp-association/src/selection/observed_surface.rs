//! Selection of the observed points.

use hicp_core::{Context, Isometry3, Point3, Problem, RigidTransform, Surfel, se3};

use crate::selection::point_selection::PointSelection;
use crate::stride::Stride;

/// Selects the observed surfels, moved into the object frame at the stage's initial pose.
///
/// It is meant for custom associations that start from the observation and search the model.
/// `source[i]` is the i-th surfel of [`hicp_core::Observation::surfels`] at this stride, moved by
/// the inverse of the initial pose. With an association that searches the observation, every
/// point would find itself.
///
/// If the estimate is not finite as `f32`, nothing is selected. Cost: O(pixels of the grid).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObservedSurface {
    /// Spacing of the selected pixels.
    pub stride: Stride,
}

impl Default for ObservedSurface {
    /// About 2,000 points.
    fn default() -> Self {
        Self {
            stride: Stride::AboutPoints(2000),
        }
    }
}

impl PointSelection for ObservedSurface {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        let object_from_camera = camera_from_object.inverse();
        let mover = RigidTransform::new(&object_from_camera);
        // Points have f32, which a finite translation may exceed.
        let origin = mover.point(&Point3::origin());
        if !se3::is_finite(&object_from_camera) || !origin.iter().all(|x| x.is_finite()) {
            return;
        }
        let Some(observation) = context.problem.observation() else {
            return;
        };
        let stride = self.stride.pixels(observation.n_surfels());
        source.extend(
            observation
                .surfels(stride)
                .map(|(_, surfel)| mover.surfel(surfel)),
        );
    }

    fn name(&self) -> &'static str {
        "observed-surface"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_image(self.name())
    }
}
