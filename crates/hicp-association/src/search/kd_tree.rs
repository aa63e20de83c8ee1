//! kiddo's k-d tree.

use hicp_core::Point3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::search::box_tree::Stack;
use crate::search::nearest::{Nearest, PointIndex};

/// kiddo's k-d tree, or `None` without points: kiddo would return item 0 at an infinite distance.
pub(crate) struct KdTree(Option<ImmutableKdTree<f32, 3>>);

impl PointIndex for KdTree {
    fn new(points: &[Point3<f32>]) -> Self {
        let points: Vec<[f32; 3]> = points.iter().map(|point| (*point).into()).collect();
        let filled = !points.is_empty();
        Self(
            filled
                .then(|| ImmutableKdTree::new_from_slice(&points).ok())
                .flatten(),
        )
    }

    fn nearest_from(
        &self,
        query: &Point3<f32>,
        _start: Nearest,
        _stack: &mut Stack,
    ) -> Option<u32> {
        let query: [f32; 3] = (*query).into();
        let found = self
            .0
            .as_ref()?
            .query(&query)
            .nearest_one::<SquaredEuclidean<f32>>()
            .execute();
        // For a query that is not finite, kiddo returns item 0 at an infinite distance.
        found.distance.is_finite().then_some(found.item)
    }
}
