//! Mutual nearest neighbors.

use hicp_core::{Context, Correspondences, Isometry3, Point3, RigidTransform, Surfel};

use crate::association::data_association::DataAssociation;
use crate::scratch::Scratch;
use crate::search::nearest::distance_squared;
use crate::search::point_tree::PointTree;

/// Keeps those pairs of another association in which no other model point is closer to the target (Pajdla & Van Gool 1995,
/// ε = 0).
///
/// With a nearest-neighbor association inside, the pairs that are mutually nearest: model points without a counterpart (the
/// hidden side, what the mask cut off) lose theirs to the points in front of them. Model points equally close to the target
/// are kept alike. The distance is taken to all moved points of the selection, whether they have a pair or not; the inner
/// association must start from these, so one that starts from the observation does not belong here.
///
/// Exact: the search tree over the moved points is rebuilt at every call, in memory that is kept. Cost: the inner association
/// and O(n log n) for n selected points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reciprocal<A> {
    /// The association whose pairs are examined.
    pub inner: A,
    scratch: Scratch<Moved>,
}

#[derive(Clone, Debug, Default)]
struct Moved {
    points: Vec<Point3<f32>>,
    tree: PointTree,
}

impl<A> Reciprocal<A> {
    /// Makes the association.
    #[must_use]
    pub fn new(inner: A) -> Self {
        Self {
            inner,
            scratch: Scratch::default(),
        }
    }
}

impl<A: DataAssociation> DataAssociation for Reciprocal<A> {
    fn associate(
        &mut self,
        context: &mut Context<'_>,
        source: &[Surfel],
        camera_from_object: &Isometry3<f64>,
        pairs: &mut Correspondences,
    ) {
        self.inner
            .associate(context, source, camera_from_object, pairs);
        let Moved { points, tree } = &mut self.scratch.0;
        let mover = RigidTransform::new(camera_from_object);
        points.clear();
        points.extend(
            source
                .iter()
                .map(|surfel| mover.point(&surfel.point))
                .filter(|point| point.iter().all(|x| x.is_finite())),
        );
        tree.rebuild(points);
        pairs.retain(|pair| {
            let own = distance_squared(&pair.target.point, &pair.source.point);
            tree.nearest(&pair.target.point)
                .is_some_and(|nearest| own <= nearest.distance_squared)
        });
    }

    fn name(&self) -> &'static str {
        "reciprocal"
    }
}
