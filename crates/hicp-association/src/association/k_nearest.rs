//! Association with several observed points.

use hicp_core::internal::Scratch;
use hicp_core::{Context, Correspondences, Isometry3, Pair, RigidTransform, Surfel};

use crate::association::data_association::DataAssociation;
use crate::search::box_tree::Stack;
use crate::search::nearest::Nearest;
use crate::search::observed_points::ObservedPoints;
use crate::search::point_tree::PointTree;
use crate::stride::Stride;

/// Pairs every model point with each of its k closest observed points, at a weight of 1/k each.
///
/// It is the soft counterpart of `NearestNeighbor`, after the multiple matches of Granger & Pennec
/// (2002). The k matches average out part of the noise of single ones, but add a bias toward the
/// middle of the neighborhood. A model point has a total weight of 1, even if fewer than k points
/// were observed. Pairs of one point are adjacent and in order of distance, and those of equal
/// distance in the order of the image. So another association can run this one and choose among the
/// pairs of each point.
///
/// Cost: O(n log n) once per observation, then at most O(log n + k²) per point, since k is meant to
/// be small.
#[derive(Clone, Debug, PartialEq)]
pub struct KNearest {
    /// Number of observed points that every model point is paired with. 0 counts as 1.
    pub k: usize,
    /// The observed pixels to search.
    pub targets: Stride,
    found: Scratch<Vec<Nearest>>,
}

impl KNearest {
    /// Creates the association.
    #[must_use]
    pub fn new(k: usize, targets: Stride) -> Self {
        Self {
            k,
            targets,
            found: Scratch::default(),
        }
    }
}

impl Default for KNearest {
    /// Three of about 4,000 pixels of an image, or of all points of a cloud.
    fn default() -> Self {
        Self::new(3, Stride::AboutPoints(4000))
    }
}

impl DataAssociation for KNearest {
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
        let (found, mut stack) = (&mut self.found.0, Stack::default());
        pairs.reserve(
            source
                .len()
                .saturating_mul(self.k.max(1).min(observed.len())),
        );
        for (source_index, surfel) in (0..).zip(source) {
            let source = mover.surfel(surfel);
            observed
                .index()
                .nearest_n(&source.point, self.k.max(1), &mut stack, found);
            let weight = 1.0 / found.len() as f32;
            for neighbor in &*found {
                let (target_index, target) = observed.get(neighbor.element);
                pairs.push(Pair {
                    weight,
                    ..Pair::new(source_index, source, target_index, target)
                });
            }
        }
    }

    fn name(&self) -> &'static str {
        "k-nearest"
    }
}
