//! Rejection of pairs at the edge of the observed surface.

use hicp_core::{Correspondences, Iteration, Pair, Problem};

use crate::boundary::{BoundaryMap, BoundaryRule};
use crate::filter::outlier_filter::OutlierFilter;

/// Removes pairs whose observed point lies at the boundary of the observed surface.
///
/// Source: Turk & Levoy 1994. Model points without a counterpart pair with the rim of the observed
/// surface and pull the object across it. Depth near an edge is also unreliable. A target is at the
/// boundary if a pixel at a chessboard distance of r ≤ `width` meets one of these conditions:
///
/// - It is outside the mask or the image, or has no depth.
/// - Its depth differs by more than r·tan(`max_tilt_degrees`)/f of the nearer one, with the smaller
///   focal length f in pixels.
///
/// Use it if the mask or the depth near edges is wrong. Correct pairs at the rim are valuable:
/// steep surface is there, and it fixes an object across the optical axis. On simulated images with
/// an exact mask, removing them raised the RMS error of projective point-to-plane. The rise was 3 %
/// to 28 % for two solid objects, and from 0.05 mm to 0.11 mm for a thin hammer. It helped only for
/// that hammer with 0.5 % of noise: from 0.36 mm to 0.26 mm (`cargo run --release -p hicp-tests
/// --example nees_report 300`).
///
/// Pairs whose target is not a surfel of the observation ([`Pair::UNLISTED`]) are kept. Without a
/// position in the region, nothing is known of them, and those of [`Contour`](crate::Contour) are
/// meant to lie at the boundary.
///
/// The filter cannot distinguish noise from steps. If the depths of neighbors differ by as much as
/// the limit, it removes pairs at random, and more of them on steep surface.
///
/// Cost: O(pixels·(2·width + 1)²) once per observation, shared by all threads, then O(1) per pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryTargets {
    /// Width of the boundary, pixels. 0 removes nothing, and values above 64 count as 64.
    pub width: u32,
    /// Largest tilt of a surface against the image plane, degrees. A steeper step is a depth edge.
    ///
    /// With 90 or more, no step is a depth edge. With NaN or a negative value, every step is,
    /// unless `width` is 0.
    pub max_tilt_degrees: f64,
}

impl Default for BoundaryTargets {
    /// One pixel and 85°, the tilt of the depth edges that limit the normals of an observation.
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
            // Without an image, the position of a target is unknown.
            pairs.retain(|_| false);
            return;
        };
        let rule = BoundaryRule::new(self.width, self.max_tilt_degrees, observation.camera());
        let boundary = BoundaryMap::of(observation, rule);
        pairs.retain(|pair| {
            pair.target_index == Pair::UNLISTED || !boundary.contains(pair.target_index)
        });
    }

    fn name(&self) -> &'static str {
        "boundary-targets"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_image(self.name())
    }
}
