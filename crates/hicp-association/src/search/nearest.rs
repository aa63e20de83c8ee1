//! Nearest points, as the search structures return them.

use hicp_core::Point3;

use crate::search::box_tree::Stack;

/// Returns |a − b|², the same bits for (b, a).
#[inline(always)]
pub(crate) fn distance_squared(a: &Point3<f32>, b: &Point3<f32>) -> f32 {
    let (x, y, z) = (a.x - b.x, a.y - b.y, a.z - b.z);
    x * x + y * y + z * z
}

/// A point that a search found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Squared distance, m², finite.
    pub distance_squared: f32,
    /// Index of the point in the order in which the points were given.
    pub element: u32,
}

impl Nearest {
    /// A result that comes after every point at a finite distance.
    pub(crate) const NONE: Self = Self {
        distance_squared: f32::MAX,
        element: u32::MAX,
    };

    /// Returns a number with the order of [`Nearest::precedes`]. The distance must not be negative.
    #[inline(always)]
    pub(crate) fn key(&self) -> u64 {
        u64::from(self.distance_squared.to_bits()) << 32 | u64::from(self.element)
    }

    /// Compares by distance. Of equally near points, the first precedes.
    #[inline(always)]
    pub(crate) fn precedes(&self, other: &Self) -> bool {
        self.distance_squared < other.distance_squared
            || (self.distance_squared == other.distance_squared && self.element < other.element)
    }
}

/// An index over points for [`NearestNeighbor`](crate::NearestNeighbor).
pub(crate) trait PointIndex: Send + Sync + 'static {
    /// Builds the index. The points must be finite.
    fn new(points: &[Point3<f32>]) -> Self;

    /// Returns the index of the point nearest to `query`.
    ///
    /// `start` is one of the points at its true distance, or [`Nearest::NONE`]. A near one saves
    /// time. The result does not depend on it. Returns `None` if no point is at a finite distance.
    fn nearest_from(&self, query: &Point3<f32>, start: Nearest, stack: &mut Stack) -> Option<u32>;
}
