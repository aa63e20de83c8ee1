//! Nearest points, as the search structures return them.

use hicp_core::Point3;

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

    #[inline(always)]
    pub(crate) fn new(distance_squared: f32, element: u32) -> Self {
        Self {
            distance_squared,
            element,
        }
    }

    /// Returns a number with the order of [`Nearest::precedes`]. The distance must not be negative.
    #[inline(always)]
    pub(crate) fn key(&self) -> u64 {
        u64::from(self.distance_squared.to_bits()) << 32 | u64::from(self.element)
    }

    /// Returns the result of a [`Nearest::key`].
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub(crate) fn of_key(key: u64) -> Self {
        Self::new(f32::from_bits((key >> 32) as u32), key as u32)
    }

    /// Compares by distance. Of equally near points, the first precedes.
    #[inline(always)]
    pub(crate) fn precedes(&self, other: &Self) -> bool {
        self.distance_squared < other.distance_squared
            || (self.distance_squared == other.distance_squared && self.element < other.element)
    }
}
