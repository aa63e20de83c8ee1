//! Selection of the whole surface.

use hicp_core::{Context, Isometry3, Surfel};

use crate::selection::point_selection::PointSelection;

/// Selects all of the model's area-uniform surface samples, visible or not: the plain reading of O in §III-A.
///
/// Points of the hidden side are among them; nearest-neighbour association drags those onto the visible surface, which is
/// why [`crate::VisibleSurface`] is the better choice where it can be rendered. Cost: a copy of the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AllSamples;

impl PointSelection for AllSamples {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        _camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        if let Some(model) = context.problem.model() {
            source.extend_from_slice(model.samples());
        }
    }

    fn name(&self) -> &'static str {
        "all-samples"
    }
}
