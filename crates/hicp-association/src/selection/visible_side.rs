//! Selection of the surface that is seen from the nearest side of an object.

use hicp_core::{Context, Isometry3, Problem, Sides, Surfel};

use crate::selection::point_selection::PointSelection;

/// Selects the surface that is visible from the side facing the camera, without a render.
///
/// The side is one of the precomputed [`Sides`] of the model, chosen at the stage's initial pose.
/// Its surfels are spread evenly over the image. Its direction is up to 20° off, so some surfels
/// may be hidden. Use it to align many hypotheses at low cost;
/// [`VisibleSurface`](crate::VisibleSurface) is exact. Clouds are not supported. Cost: a copy of
/// the surfels, and some 0.1 ms for the first pose of a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VisibleSide {
    /// Approximate number of surfels on each side.
    pub count: usize,
}

impl PointSelection for VisibleSide {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        if let Some((model, _)) = context.problem.sides() {
            source.extend_from_slice(
                &Sides::of(model, self.count)
                    .facing(camera_from_object)
                    .surfels,
            );
        }
    }

    fn name(&self) -> &'static str {
        "visible-side"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_mesh_or_image(self.name())
    }
}
