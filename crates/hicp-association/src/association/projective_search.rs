//! Projective association with a search around the pixel.

use hicp_core::{
    Context, Correspondences, Isometry3, Observation, Pair, Problem, RigidTransform, Surfel,
};

use crate::association::data_association::DataAssociation;
use crate::association::pixel_projection::PixelProjection;
use crate::search::nearest::distance_squared;

/// Pairs a model point with the closest observed point in a window around its projected pixel.
///
/// Sources: Benjemaa & Schmitt 1997; Dorai et al. 1998. It is a compromise between
/// [`Projective`](crate::Projective), which it equals at radius 0, and a nearest-neighbor search. A
/// window of ±r pixels bridges misalignments and holes of r pixels, and does not need a tree.
///
/// Distances are in three dimensions. Of equally close points, the first in row-major order is
/// used. The window is clipped at the border of the observed region. A point that projects outside
/// the image has no pair.
///
/// Cost: O((2r + 1)²) per point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProjectiveSearch {
    /// Half side r of the window, pixels. Values above 64 count as 64.
    pub radius: u32,
}

/// The largest effective half side, pixels.
const MAX_RADIUS: u32 = 64;

impl Default for ProjectiveSearch {
    /// A window of 5×5 pixels.
    fn default() -> Self {
        Self { radius: 2 }
    }
}

impl DataAssociation for ProjectiveSearch {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let Some(observation) = context.problem.observation() else {
            return;
        };
        let projection = PixelProjection::new(observation.camera());
        let mover = RigidTransform::new(camera_from_object);
        let radius = self.radius.min(MAX_RADIUS);
        pairs.reserve(source.len());
        for (source_index, surfel) in (0..).zip(source) {
            let source = mover.surfel(surfel);
            let Some((u, v)) = projection.project(&source.point) else {
                continue;
            };
            if let Some((target_index, target)) = closest(observation, &source, u, v, radius) {
                pairs.push(Pair::new(source_index, source, target_index, target));
            }
        }
    }

    fn name(&self) -> &'static str {
        "projective-search"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        problem.without_image(self.name())
    }
}

fn closest(
    observation: &Observation,
    source: &Surfel,
    u: f32,
    v: f32,
    radius: u32,
) -> Option<(u32, Surfel)> {
    let (width, height) = (observation.camera().width(), observation.camera().height());
    // As in the plain projection, a pixel's square extends half a pixel to every side. False for
    // NaN.
    let (column, row) = (u + 0.5, v + 0.5);
    if !(column >= 0.0 && row >= 0.0 && column < width as f32 && row < height as f32) {
        return None;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // Floor of a checked value.
    let (column, row) = (column as u32, row as u32);
    let region = observation.region();
    let rows = row.saturating_sub(radius).max(region.v_min)..(row + radius + 1).min(region.v_max);
    let mut best: Option<(f32, u32, Surfel)> = None;
    for row in rows {
        let from = column.saturating_sub(radius).max(region.u_min);
        let to = (column + radius + 1).min(region.u_max);
        if from >= to {
            continue;
        }
        // This fits into `u32`: an accepted image has at most 2³⁰ pixels.
        let first = (row - region.v_min) * (region.u_max - region.u_min) + (from - region.u_min);
        for index in first..first + (to - from) {
            let Some(target) = observation.surfel(index) else {
                continue;
            };
            let distance = distance_squared(&source.point, &target.point);
            if best.is_none_or(|(smallest, _, _)| distance < smallest) {
                best = Some((distance, index, *target));
            }
        }
    }
    best.map(|(_, index, target)| (index, target))
}
