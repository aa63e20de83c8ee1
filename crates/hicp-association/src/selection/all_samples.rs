//! Selection of the whole surface.

use hicp_core::{Context, Isometry3, Surfel};

use crate::selection::point_selection::PointSelection;

/// Selects all of the model's area-uniform surface samples, visible or not, or all points of a
/// cloud.
///
/// It is the literal reading of O in §III-A. Nearest-neighbor association drags points of the
/// hidden side onto the visible surface. If the model can be rendered,
/// [`VisibleSurface`](crate::VisibleSurface) is therefore the better choice. Cost: a copy of the
/// samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AllSamples;

impl PointSelection for AllSamples {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        _camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        if let Some(side) = context.problem.source() {
            source.extend_from_slice(side.surfels());
        }
    }

    fn name(&self) -> &'static str {
        "all-samples"
    }
}
