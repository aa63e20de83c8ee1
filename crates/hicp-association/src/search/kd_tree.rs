//! kiddo's k-d tree.

use hicp_core::Point3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::search::box_tree::Stack;
use crate::search::nearest::Nearest;
use crate::search::neighborhood::Found;
use crate::search::point_index::PointIndex;

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

    fn points_near(&self, query: &Point3<f32>, _within: f32, _stack: &mut Stack) -> Found {
        let query: [f32; 3] = (*query).into();
        let nearest = self.0.as_ref().map(|tree| {
            tree.query(&query)
                .nearest_one::<SquaredEuclidean<f32>>()
                .execute()
        });
        // For a query that is not finite, kiddo returns item 0 at an infinite distance.
        let nearest = nearest.filter(|nearest| nearest.distance.is_finite());
        let nearest = nearest.map(|nearest| Nearest::new(nearest.distance, nearest.item));
        Found::only(nearest.unwrap_or(Nearest::NONE))
    }
}
