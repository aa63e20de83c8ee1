//! Nearest-neighbour data association.

use hicp_core::{Context, Correspondences, Isometry3, Pair, Point3, RigidTransform, Surfel};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::association::data_association::DataAssociation;
use crate::search::observed_points::ObservedPoints;
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
        let Some(observation) = context.problem.observation() else {
            return;
        };
        let index = ObservedPoints::of(observation, self.targets, KdTree::new);
        let mover = RigidTransform::new(camera_from_object);
        pairs.reserve(source.len());
        for (source_index, surfel) in (0..).zip(source) {
            let source = mover.surfel(surfel);
            if let Some(element) = index.tree().nearest(&source.point) {
                let (target_index, target) = index.get(element);
                pairs.push(Pair::new(source_index, source, target_index, target));
            }
        }
    }

    fn name(&self) -> &'static str {
        "nearest-neighbor"
    }
}

/// `None` when there is nothing to find: the tree would answer with item 0 at an infinite distance.
struct KdTree(Option<ImmutableKdTree<f32, 3>>);

impl KdTree {
    #[allow(clippy::needless_pass_by_value)] // As every tree over observed points is built.
    fn new(points: Vec<Point3<f32>>) -> Self {
        let points: Vec<[f32; 3]> = points.iter().map(|point| (*point).into()).collect();
        let filled = !points.is_empty();
        Self(
            filled
                .then(|| ImmutableKdTree::new_from_slice(&points).ok())
                .flatten(),
        )
    }

    fn nearest(&self, query: &Point3<f32>) -> Option<u32> {
        let query: [f32; 3] = (*query).into();
        let found = self
            .0
            .as_ref()?
            .query(&query)
            .nearest_one::<SquaredEuclidean<f32>>()
            .execute();
        // A query that is not finite "finds" item 0 at an infinite distance.
        found.distance.is_finite().then_some(found.item)
    }
}
