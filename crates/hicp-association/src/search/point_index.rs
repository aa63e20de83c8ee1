//! An index over points, as nearest neighbors use it.

use hicp_core::Point3;

use crate::search::box_tree::Stack;
use crate::search::nearest::Nearest;
use crate::search::neighborhood::{Found, Neighborhood};

/// An index over points for [`NearestNeighbor`](crate::NearestNeighbor).
pub(crate) trait PointIndex: Send + Sync + 'static {
    /// Builds the index. The points must be finite.
    fn new(points: &[Point3<f32>]) -> Self;

    /// Returns the nearest points within a squared distance of a query.
    fn points_near(&self, query: &Point3<f32>, within: f32, stack: &mut Stack) -> Found;

    /// Returns the index of the point nearest to `query`.
    ///
    /// Returns `None` if no point is at a finite distance. `near` is what an earlier query to the
    /// same points left, or [`Neighborhood::UNKNOWN`]. The result does not depend on it. `point`
    /// returns a point by its index.
    #[inline(always)]
    fn nearest_to_moved(
        &self,
        query: &Point3<f32>,
        near: &mut Neighborhood,
        stack: &mut Stack,
        point: impl Fn(u32) -> Point3<f32>,
    ) -> Option<u32> {
        let within = match near.nearest(query) {
            Ok(element) => return Some(element),
            Err(within) => within,
        };
        let found = self.points_near(query, within, stack);
        let Nearest { element, .. } = found.first();
        if element == Nearest::NONE.element {
            return None;
        }
        near.replace(query, &found, point);
        Some(element)
    }
}
