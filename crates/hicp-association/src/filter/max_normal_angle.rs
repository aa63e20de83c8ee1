//! Rejection by the angle between normals.

use hicp_core::{Correspondences, Iteration};

use crate::filter::outlier_filter::OutlierFilter;
use crate::length::narrow;

/// Removes pairs whose normals differ by more than θ_max (§III-A.1; Pulli 1999).
///
/// Cost: O(pairs).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaxNormalAngle {
    /// Largest angle θ_max, degrees.
    ///
    /// 180 or more keeps every pair. NaN and negative values remove every pair.
    pub degrees: f64,
}

impl MaxNormalAngle {
    /// Creates the filter with a limit in degrees.
    #[must_use]
    pub fn degrees(degrees: f64) -> Self {
        Self { degrees }
    }
}

impl OutlierFilter for MaxNormalAngle {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let min_cosine = min_cosine(self.degrees);
        pairs.retain(|pair| pair.source.normal.dot(&pair.target.normal) >= min_cosine);
    }

    fn name(&self) -> &'static str {
        "max-normal-angle"
    }
}

/// Returns the least n·m of unit normals that differ by at most `degrees`.
///
/// For NaN and negative angles, it is greater than every product.
pub(crate) fn min_cosine(degrees: f64) -> f32 {
    if degrees >= 180.0 {
        // Rounding may put the cosine of opposite normals just below −1 …
        -2.0
    } else if degrees >= 0.0 {
        // … and that of equal ones just below 1.
        narrow(degrees).to_radians().cos() - 1e-6
    } else {
        f32::INFINITY
    }
}
