//! Nearest neighbors with a similar orientation.

use hicp_core::internal::Scratch;
use hicp_core::{Context, Correspondences, Isometry3, Pair, RigidTransform, Surfel};

use crate::association::data_association::DataAssociation;
use crate::filter::max_normal_angle::min_cosine;
use crate::search::box_tree::Stack;
use crate::search::nearest::Nearest;
use crate::search::observed_points::ObservedPoints;
use crate::search::point_tree::PointTree;
use crate::stride::Stride;

/// Pairs every model point with the closest observed point whose normal is compatible.
///
/// Sources: Godin et al. 1994; Pulli 1999. Among the k closest observed points, it selects the
/// closest with n·m ≥ cos θ_max. If there is none, the point has no pair.
///
/// If two sheets of the surface are close to each other (a mug's wall, a thin plate), the plain
/// nearest neighbor lies on the wrong one. Rejecting it later leaves the point without a pair; this
/// association finds the point behind it.
///
/// Cost: at most O(log n + k²) per point, since k is meant to be small.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalCompatible {
    /// Largest angle between the two normals, degrees. NaN and negative values pair nothing.
    pub max_angle_degrees: f64,
    /// Number of closest observed points to consider. 0 counts as 1.
    pub k: usize,
    /// The observed pixels to search.
    pub targets: Stride,
    found: Scratch<Vec<Nearest>>,
}

impl NormalCompatible {
    /// Creates the association.
    #[must_use]
    pub fn new(max_angle_degrees: f64, k: usize, targets: Stride) -> Self {
        Self {
            max_angle_degrees,
            k,
            targets,
            found: Scratch::default(),
        }
    }
}

impl Default for NormalCompatible {
    /// Within 45° (Pulli 1999), among the 10 closest of about 4,000 pixels of an image, or of all
    /// points of a cloud.
    fn default() -> Self {
        Self::new(45.0, 10, Stride::AboutPoints(4000))
    }
}

impl DataAssociation for NormalCompatible {
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
        let min_cosine = min_cosine(self.max_angle_degrees);
        let (found, mut stack) = (&mut self.found.0, Stack::default());
        pairs.reserve(source.len());
        for (source_index, surfel) in (0..).zip(source) {
            let source = mover.surfel(surfel);
            observed
                .index()
                .nearest_n(&source.point, self.k.max(1), &mut stack, found);
            let compatible = found
                .iter()
                .map(|neighbor| observed.get(neighbor.element))
                .find(|(_, target)| source.normal.dot(&target.normal) >= min_cosine);
            if let Some((target_index, target)) = compatible {
                pairs.push(Pair::new(source_index, source, target_index, target));
            }
        }
    }

    fn name(&self) -> &'static str {
        "normal-compatible"
    }
}
