//! Nearest-neighbour data association.

use std::sync::Arc;

use hicp_core::{Context, Correspondences, Isometry3, Mover, Observation, Pair, Surfel};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::association::DataAssociation;
use crate::stride::Stride;

/// Pairs every model point with the closest observed point (§III-A.1; Besl & McKay 1992), through a k-d tree.
///
/// The tree over the observed surfels is built once per observation and stride and shared by all threads and hypotheses.
/// An observation without surfels gives no pairs. Cost: O(n log n) once per observation, then O(log n) per point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NearestNeighbor {
    /// Which observed pixels enter the tree. A tree that fits the cache answers several times faster, at hardly any loss of accuracy.
    pub targets: Stride,
}

impl Default for NearestNeighbor {
    /// About 4,000 observed points.
    // Deviation: §III-A.1 searches all of C; a strided C is faster to search at hardly any loss of accuracy. `Stride::Pixels(1)` searches all.
    fn default() -> Self {
        Self {
            targets: Stride::AboutPoints(4000),
        }
    }
}

impl DataAssociation for NearestNeighbor {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        let index = TargetIndex::of(context.problem.observation, self.targets);
        let mover = Mover::new(camera_from_object);
        pairs.reserve(source.len());
        for (source_index, surfel) in (0..).zip(source) {
            let source = mover.surfel(surfel);
            if let Some((target_index, target)) = index.nearest(&source) {
                pairs.push(Pair::new(source_index, source, target_index, target));
            }
        }
    }

    fn name(&self) -> &'static str {
        "nearest-neighbor"
    }
}

/// The observed surfels of one stride with their indices, and the tree over their positions.
struct TargetIndex {
    surfels: Vec<(u32, Surfel)>,
    /// `None` when there is nothing to find: the tree would answer with item 0 at an infinite distance.
    tree: Option<ImmutableKdTree<f32, 3>>,
}

impl TargetIndex {
    fn of(observation: &Observation, targets: Stride) -> Arc<Self> {
        let stride = targets.pixels(observation.n_surfels());
        observation
            .derived()
            .get_or_build(u64::from(stride), || Self::build(observation, stride))
    }

    fn build(observation: &Observation, stride: u32) -> Self {
        // An observation's surfels are finite by construction, so no NaN reaches the tree.
        let surfels: Vec<(u32, Surfel)> =
            observation.surfels(stride).map(|(i, s)| (i, *s)).collect();
        let points: Vec<[f32; 3]> = surfels.iter().map(|(_, s)| s.point.into()).collect();
        let tree = if points.is_empty() {
            None
        } else {
            ImmutableKdTree::new_from_slice(&points).ok()
        };
        Self { surfels, tree }
    }

    fn nearest(&self, source: &Surfel) -> Option<(u32, Surfel)> {
        let found = self
            .tree
            .as_ref()?
            .query(&source.point.into())
            .nearest_one::<SquaredEuclidean<f32>>()
            .execute();
        // A query that is not finite "finds" item 0 at an infinite distance.
        found
            .distance
            .is_finite()
            .then(|| self.surfels.get(found.item as usize).copied())
            .flatten()
    }
}
