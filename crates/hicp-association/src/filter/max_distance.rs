//! Rejection by distance.

use hicp_core::{Correspondences, Iteration};

use crate::filter::outlier_filter::OutlierFilter;
use crate::length::Length;

/// Removes pairs further apart than τ_max (§III-A.1; Turk & Levoy 1994).
///
/// It also removes pairs whose distance is not finite. Cost: O(pairs).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaxDistance(
    /// Largest distance τ_max. With NaN and negative values, every pair is removed.
    pub Length,
);

impl MaxDistance {
    /// Creates the filter with a limit in meters.
    #[must_use]
    pub fn meters(limit: f64) -> Self {
        Self(Length::Meters(limit))
    }

    /// Creates the filter with a limit as a fraction of the model's diameter.
    ///
    /// It then fits objects of any size.
    #[must_use]
    pub fn diameters(fraction: f64) -> Self {
        Self(Length::Diameters(fraction))
    }
}

impl OutlierFilter for MaxDistance {
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        keep_within(pairs, self.0.meters(&iteration.problem));
    }

    fn name(&self) -> &'static str {
        "max-distance"
    }
}

/// Keeps the pairs at most `limit` meters apart, and removes those whose distance is not finite.
pub(crate) fn keep_within(pairs: &mut Correspondences, limit: f32) {
    pairs.retain(|pair| {
        let distance = pair.distance();
        distance.is_finite() && distance <= limit
    });
}
