//! Exact nearest points.

use hicp_core::Point3;

use crate::search::box_tree::{Bounds, BoxTree, Found, distance_squared};

/// A [`BoxTree`] over points, with the points in the order of its leaves.
#[derive(Clone, Debug, Default)]
pub(crate) struct PointTree {
    tree: BoxTree,
    points: Vec<Point3<f32>>,
}

impl PointTree {
    /// Builds a tree over points, which must be finite.
    #[allow(clippy::needless_pass_by_value)] // As every tree over observed points is built.
    pub(crate) fn new(points: Vec<Point3<f32>>) -> Self {
        let mut tree = Self::default();
        tree.rebuild(points.len(), |i| points[i]);
        tree
    }

    /// Builds the tree anew, reusing its memory. Points must be finite; `point(i)` is the i-th of `count`.
    pub(crate) fn rebuild(&mut self, count: usize, point: impl Fn(usize) -> Point3<f32>) {
        self.tree.rebuild(count, |element| {
            let point = point(element as usize);
            Bounds {
                min: point,
                max: point,
            }
        });
        self.points.clear();
        let order = self.tree.order();
        self.points
            .extend(order.iter().map(|element| point(*element as usize)));
    }

    /// Returns the nearest point among those that `accept` takes by their index; of equally near ones the first.
    #[inline]
    pub(crate) fn nearest_where(
        &self,
        query: &Point3<f32>,
        accept: impl Fn(usize) -> bool,
    ) -> Option<Found> {
        let order = self.tree.order();
        self.tree.nearest(query, |slot| {
            accept(order[slot] as usize).then(|| distance_squared(query, &self.points[slot]))
        })
    }

    /// Returns the nearest point; of equally near ones the first.
    #[inline]
    pub(crate) fn nearest(&self, query: &Point3<f32>) -> Option<Found> {
        self.tree.nearest(query, |slot| {
            Some(distance_squared(query, &self.points[slot]))
        })
    }

    /// Replaces the content of `found` by the `count` nearest points, nearest first.
    pub(crate) fn nearest_n(&self, query: &Point3<f32>, count: usize, found: &mut Vec<Found>) {
        self.tree.nearest_n(query, count, found, |slot| {
            Some(distance_squared(query, &self.points[slot]))
        });
    }
}
