//! Rejection of pairs at the edge of what was observed.

use hicp_core::{Correspondences, Iteration};

use crate::boundary::{BoundaryMap, BoundaryRule};
use crate::filter::outlier_filter::OutlierFilter;

/// Removes pairs whose observed point lies where the observed surface ends (Turk & Levoy 1994).
///
/// Model points that have no counterpart pair up with the rim of what was seen and pull the object across it; depth beside
/// an edge is unreliable too. A target is at the boundary when a pixel at a chessboard distance of r ≤ `width` is outside
/// the mask or the image, has no depth, or differs in depth by more than r·tan(`max_tilt_degrees`)/f of the nearer one, f the
/// smaller focal length in pixels. Found once per observation and shared by all threads: O(pixels·(2·width + 1)²), then
/// constant per pair.
///
/// For where the mask or the depth beside edges is wrong. Right pairs at the rim are worth keeping: steep surface is there, and
/// it is what holds an object across the optical axis. On simulated images with an exact mask, removing them raised the RMS error
/// of projective point-to-plane by 3 % to 28 % for two solid objects and from 0.05 mm to 0.11 mm for a thin hammer; for that
/// hammer at 0.5 % of noise alone did it help, from 0.36 mm to 0.26 mm
/// (`cargo run --release -p hicp-tests --example nees_report 300`).
///
/// Noise is not told from steps: where the depth of neighbours differs by as much as the limit, pairs go at random, and more
/// of those on steep surface than on level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryTargets {
    /// How many pixels wide the boundary is; 0 removes nothing, and above 64 counts as 64.
    pub width: u32,
    /// Largest tilt of a surface against the image plane, degrees: what is steeper is a depth edge. From 90 on nothing is. NaN
    /// and negative values make everything a boundary, unless `width` is 0.
    pub max_tilt_degrees: f32,
}

impl Default for BoundaryTargets {
    /// One pixel and 85°, where the normals of an observation see an edge too.
    fn default() -> Self {
        Self {
            width: 1,
            max_tilt_degrees: 85.0,
        }
    }
}

impl OutlierFilter for BoundaryTargets {
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let Some(observation) = iteration.problem.observation() else {
            // Without an image no target is known to be inside of it.
            pairs.retain(|_| false);
            return;
        };
        let rule = BoundaryRule::new(self.width, self.max_tilt_degrees, observation.camera());
        let boundary = BoundaryMap::of(observation, rule);
        pairs.retain(|pair| !boundary.contains(pair.target_index));
    }

    fn name(&self) -> &'static str {
        "boundary-targets"
    }
}
