//! Evenly spaced subsets.

use hicp_core::{Context, Isometry3, Problem, Surfel};

use crate::selection::all_samples::AllSamples;
use crate::selection::keep::{keep_positions, spread};
use crate::selection::point_selection::PointSelection;

/// Keeps `count` points of another selection, evenly spaced in its order.
///
/// Source: the uniform subsampling of Turk & Levoy 1994. The order of the model's samples follows
/// the surface area, and that of a rendered surface follows the image. Even spacing in the order is
/// therefore an even spread. The i-th kept point is at position ⌊(i + ½)·n/count⌋ of n. If there
/// are at most `count` points, all are kept. Cost: the inner selection, and O(count).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UniformCount<P> {
    /// The selection to select from.
    pub selection: P,
    /// Number of points to keep.
    pub count: usize,
}

impl Default for UniformCount<AllSamples> {
    /// 500 of the model's samples.
    fn default() -> Self {
        Self {
            selection: AllSamples,
            count: 500,
        }
    }
}

impl<P: PointSelection> PointSelection for UniformCount<P> {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        self.selection.select(context, camera_from_object, source);
        let (count, length) = (self.count, source.len());
        if count < length {
            keep_positions(source, (0..count).map(|i| spread(i, count, length)));
        }
    }

    fn name(&self) -> &'static str {
        "uniform-count"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.selection.unsupported(problem)
    }
}
