//! Mutual nearest neighbors.

use hicp_core::internal::Scratch;
use hicp_core::{Context, Correspondences, Isometry3, Point3, Problem, RigidTransform, Surfel};

use crate::association::data_association::DataAssociation;
use crate::search::box_tree::Stack;
use crate::search::nearest::distance_squared;
use crate::search::point_tree::PointTree;

/// Keeps those pairs of another association whose source is the model point closest to the target.
///
/// Source: Pajdla & Van Gool 1995, with ε = 0. With a nearest-neighbor association inside, the
/// remaining pairs are mutually nearest. Model points without a counterpart (on the hidden side, or
/// outside of the mask) lose their pairs to the points in front of them. Model points equally close
/// to the target are all kept.
///
/// The distance is compared with that of all moved points of the selection, with or without a pair.
/// The inner association must therefore start from the selection and not from the observation. The
/// result is exact, because the search tree over the moved points is rebuilt at every call, in
/// reused memory.
///
/// Cost: the inner association, and O(n log n) for n selected points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reciprocal<A> {
    /// The association whose pairs are filtered.
    pub association: A,
    scratch: Scratch<Moved>,
}

#[derive(Clone, Debug, Default)]
struct Moved {
    points: Vec<Point3<f32>>,
    tree: PointTree,
}

impl<A> Reciprocal<A> {
    /// Creates the association.
    #[must_use]
    pub fn new(association: A) -> Self {
        Self {
            association,
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
        let earlier = pairs.len();
        self.association
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
        let (mut position, mut stack) = (0, Stack::default());
        pairs.retain(|pair| {
            position += 1;
            if position <= earlier {
                return true;
            }
            let own = distance_squared(&pair.target.point, &pair.source.point);
            tree.nearest(&pair.target.point, &mut stack)
                .is_some_and(|nearest| own <= nearest.distance_squared)
        });
    }

    fn name(&self) -> &'static str {
        "reciprocal"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.association.unsupported(problem)
    }
}
