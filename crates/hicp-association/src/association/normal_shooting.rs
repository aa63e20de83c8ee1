//! Association along the normal.

use hicp_core::internal::Scratch;
use hicp_core::{Context, Correspondences, Isometry3, Pair, RigidTransform, Surfel};

use crate::association::data_association::DataAssociation;
use crate::length::Length;
use crate::search::box_tree::Stack;
use crate::search::nearest::Nearest;
use crate::search::observed_points::ObservedPoints;
use crate::search::point_tree::PointTree;
use crate::stride::Stride;

/// Pairs every model point with the observed point closest to the line along its normal.
///
/// Source: Chen & Medioni 1991. For point sets, the intersection of the line (p, n) with the
/// observed surface becomes a search. Among the k observed points closest to p, it selects the one
/// with the smallest distance |(c − p) − n (n·(c − p))| to the line. Of equally distant points, it
/// selects the one closest to p. Both directions of the line count.
///
/// On smooth surfaces it converges faster than the nearest neighbor. On noisy or complex ones it is
/// less stable (Rusinkiewicz & Levoy 2001).
///
/// Cost: O(n log n) once per observation, then O(log n + k) per point.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalShooting {
    /// Number of closest observed points to consider. 0 counts as 1.
    ///
    /// If the surfaces are far apart and k is too small, the intersection is not among these
    /// points.
    pub k: usize,
    /// Largest distance of a target from the line; `None` for no limit.
    ///
    /// NaN and negative lengths pair nothing.
    pub max_offset: Option<Length>,
    /// The observed pixels to search.
    pub targets: Stride,
    found: Scratch<Vec<Nearest>>,
}

impl NormalShooting {
    /// Creates the association.
    #[must_use]
    pub fn new(k: usize, max_offset: Option<Length>, targets: Stride) -> Self {
        Self {
            k,
            max_offset,
            targets,
            found: Scratch::default(),
        }
    }
}

impl Default for NormalShooting {
    /// Among the 10 closest of about 4,000 pixels of an image, or of all points of a cloud, at any
    /// distance from the line.
    fn default() -> Self {
        Self::new(10, None, Stride::AboutPoints(4000))
    }
}

impl DataAssociation for NormalShooting {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let Some(target) = context.problem.target() else {
            return;
        };
        let observed = ObservedPoints::<PointTree>::of(target, self.targets);
        let mover = RigidTransform::new(camera_from_object);
        let limit = self
            .max_offset
            .map_or(f32::INFINITY, |length| length.meters(&context.problem));
        let (found, mut stack) = (&mut self.found.0, Stack::default());
        pairs.reserve(source.len());
        for (source_index, surfel) in (0..).zip(source) {
            let source = mover.surfel(surfel);
            observed
                .index()
                .nearest_n(&source.point, self.k.max(1), &mut stack, found);
            let mut best: Option<(f32, u32, Surfel)> = None;
            for neighbor in &*found {
                let (target_index, target) = observed.get(neighbor.element);
                let offset = distance_to_line(&source, &target);
                if best.is_none_or(|(smallest, _, _)| offset < smallest) {
                    best = Some((offset, target_index, target));
                }
            }
            if let Some((offset, target_index, target)) = best
                && offset <= limit
            {
                pairs.push(Pair::new(source_index, source, target_index, target));
            }
        }
    }

    fn name(&self) -> &'static str {
        "normal-shooting"
    }
}

/// Returns the distance of the target's point from the line through the source's point along its
/// normal.
fn distance_to_line(source: &Surfel, target: &Surfel) -> f32 {
    let (normal, difference) = (source.normal.as_ref(), target.point - source.point);
    (difference - normal * normal.dot(&difference)).norm()
}
