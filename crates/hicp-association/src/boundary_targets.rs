//! Rejection of pairs at the edge of what was observed.

use hicp_core::{Correspondences, Problem};

use crate::boundary::{BoundaryMap, BoundaryRule};
use crate::filter::OutlierFilter;

/// Removes pairs whose observed point lies where the observed surface ends (Turk & Levoy 1994).
///
/// Model points that have no counterpart pair up with the rim of what was seen and pull the object across it; depth beside
/// an edge is unreliable too. A target is at the boundary when a pixel at a chessboard distance of r ≤ `width` is outside
/// the mask or the image, has no depth, or differs in depth by more than r·`max_step` of the nearer one. Found once per
/// observation and shared by all threads: O(pixels·(2·width + 1)²), then constant per pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryTargets {
    /// How many pixels wide the boundary is; 0 removes nothing, and above 64 counts as 64.
    pub width: u32,
    /// Largest difference in depth between neighbouring pixels of one surface, as a fraction of the depth. NaN and negative
    /// values make everything a boundary, unless `width` is 0.
    pub max_step: f32,
}

impl Default for BoundaryTargets {
    /// One pixel, and 2 % of the depth: a surface tilted by 85° at a focal length of 570 pixels.
    fn default() -> Self {
        Self {
            width: 1,
            max_step: 0.02,
        }
    }
}

impl OutlierFilter for BoundaryTargets {
    fn filter(&mut self, problem: &Problem<'_>, pairs: &mut Correspondences) {
        let Self { width, max_step } = *self;
        let boundary = BoundaryMap::of(problem.observation, BoundaryRule { width, max_step });
        pairs.retain(|pair| !boundary.contains(pair.target_index));
    }
}
