//! Rejection by the median absolute deviation.

use hicp_core::internal::{Scratch, median};
use hicp_core::{Correspondences, Iteration};

use crate::filter::max_distance::keep_within;
use crate::filter::outlier_filter::OutlierFilter;
use crate::filter::quantile::distances::collect_finite;
use crate::length::narrow;

/// σ of a normal distribution, divided by its median absolute deviation.
const SIGMA_PER_MAD: f32 = 1.4826;

/// Removes pairs whose distance exceeds the median by more than `factor` robust deviations.
///
/// Sources: rule X84 of Hampel et al. 1986; for ICP, Fusiello et al. 2002. It keeps d ≤ med +
/// factor·max(1.4826·MAD, floor), where MAD is the median of |d − med|. Pairs closer than the
/// median are never outliers.
///
/// The floor keeps distances that differ by less than the resolution of the sensor. Without it, a
/// well aligned object with nearly equal distances would lose every pair with a rounding error.
/// Distances that are not finite are ignored, and their pairs are removed. Cost: O(pairs).
#[derive(Clone, Debug, PartialEq)]
pub struct MadDistance {
    /// Number of standard deviations above the median. NaN removes every pair.
    pub factor: f64,
    /// Smallest assumed standard deviation, meters. NaN and negative values count as 0.
    pub floor: f64,
    distances: Scratch<Vec<f32>>,
}

impl MadDistance {
    /// Creates the filter. The floor is in meters.
    #[must_use]
    pub fn new(factor: f64, floor: f64) -> Self {
        Self {
            factor,
            floor,
            distances: Scratch::default(),
        }
    }
}

impl Default for MadDistance {
    /// Three standard deviations of at least 1 mm, the resolution of most depth images.
    fn default() -> Self {
        Self::new(3.0, 0.001)
    }
}

impl OutlierFilter for MadDistance {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let distances = &mut self.distances.0;
        collect_finite(pairs, distances);
        let center = median(distances, f32::total_cmp).unwrap_or(0.0);
        for distance in &mut *distances {
            *distance = (*distance - center).abs();
        }
        let deviation = SIGMA_PER_MAD * median(distances, f32::total_cmp).unwrap_or(0.0);
        keep_within(
            pairs,
            center + narrow(self.factor) * deviation.max(narrow(self.floor).max(0.0)),
        );
    }

    fn name(&self) -> &'static str {
        "mad-distance"
    }
}
