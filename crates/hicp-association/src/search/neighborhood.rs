//! The points near an earlier query.

use hicp_core::Point3;
use hicp_core::internal::stored;

use crate::search::nearest::Nearest;

/// Number of points. More answer more queries, but each takes longer.
const POINTS: usize = 4;
/// Computed distances differ from the true ones by less than this factor.
const ROUNDING: f32 = 1.0 - 1.0e-5;

/// The points of an index that are nearest to an earlier query.
///
/// If the query has moved by m since then, every other point is nearer to it by m at most. So if
/// one of these points is near enough, it is the nearest, and no search is needed (compare
/// Greenspan & Godin 2001).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Neighborhood {
    /// The earlier query.
    center: Point3<f32>,
    /// No other point of the index is nearer to the center, meters.
    reach: f32,
    /// The points: `points[axis][lane]`. Missing ones lie at infinity.
    points: [[f32; POINTS]; 3],
    elements: [u32; POINTS],
}

impl Neighborhood {
    /// A neighborhood of which nothing is known.
    pub(crate) const UNKNOWN: Self = Self {
        center: Point3::new(0.0, 0.0, 0.0),
        reach: 0.0,
        points: [[f32::INFINITY; POINTS]; 3],
        elements: [u32::MAX; POINTS],
    };

    /// Returns the element nearest to a query if it is one of these for certain.
    ///
    /// Else returns a squared distance within which there are as many points, or `f32::MAX`.
    #[inline(always)]
    pub(crate) fn nearest(&self, query: &Point3<f32>) -> Result<u32, f32> {
        let distances = stored(distances(&self.points, query));
        let nearest = (distances.iter().zip(&self.elements))
            .map(|(distance, element)| Nearest::new(*distance, *element).key())
            .fold(u64::MAX, u64::min);
        let nearest = Nearest::of_key(nearest);
        let moved = (query - self.center).norm();
        if nearest.distance_squared.sqrt() + moved < self.reach * ROUNDING {
            return Ok(nearest.element);
        }
        let farthest = distances.into_iter().fold(0.0, f32::max);
        Err(farthest.min(f32::MAX))
    }

    /// Moves the neighborhood to a query around which these points were found.
    #[inline(always)]
    pub(crate) fn replace(
        &mut self,
        query: &Point3<f32>,
        found: &Found,
        point: impl Fn(u32) -> Point3<f32>,
    ) {
        *self = Self {
            center: *query,
            reach: found.last().distance_squared.sqrt(),
            ..Self::UNKNOWN
        };
        for (lane, key) in found.0.iter().enumerate() {
            let Nearest { element, .. } = Nearest::of_key(*key);
            if element != Nearest::NONE.element {
                let point = point(element);
                for (axis, coordinates) in self.points.iter_mut().enumerate() {
                    coordinates[lane] = point[axis];
                }
                self.elements[lane] = element;
            }
        }
    }
}

/// The nearest points that a search found, nearest first.
pub(crate) struct Found([u64; POINTS]);

impl Found {
    /// Returns a list with `point` at every place.
    pub(crate) fn only(point: Nearest) -> Self {
        Self([point.key(); POINTS])
    }

    /// Inserts a point, and drops the last one. Returns the squared distance of the last one.
    #[inline(always)]
    pub(crate) fn insert(&mut self, point: Nearest) -> f32 {
        let (key, mut before) = (point.key(), 0);
        for place in &mut self.0 {
            let moved = key.max(before).min(*place);
            before = *place;
            *place = moved;
        }
        self.last().distance_squared
    }

    /// Returns the nearest point, or [`Nearest::NONE`].
    #[inline(always)]
    pub(crate) fn first(&self) -> Nearest {
        Nearest::of_key(self.0[0])
    }

    #[inline(always)]
    fn last(&self) -> Nearest {
        Nearest::of_key(self.0[POINTS - 1])
    }
}

/// Returns the squared distances of points in lanes.
///
/// They are rounded as in [`distance_squared`](super::nearest::distance_squared).
#[inline(always)]
pub(crate) fn distances<const N: usize>(points: &[[f32; N]; 3], query: &Point3<f32>) -> [f32; N] {
    let mut distances = [0.0; N];
    for (lane, distance) in distances.iter_mut().enumerate() {
        let (x, y, z) = (
            query.x - points[0][lane],
            query.y - points[1][lane],
            query.z - points[2][lane],
        );
        *distance = x * x + y * y + z * z;
    }
    distances
}
