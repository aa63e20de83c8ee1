//! Rejection by the median absolute deviation.

use hicp_core::{Correspondences, Iteration};

use crate::filter::distances::{collect_finite, median};
use crate::filter::max_distance::keep_within;
use crate::filter::outlier_filter::OutlierFilter;
use crate::scratch::Scratch;

/// σ of a normal distribution over its median absolute deviation.
const SIGMA_PER_MAD: f32 = 1.4826;

/// Removes pairs whose distance exceeds the median by more than `factor` robust standard deviations (X84, Hampel et al. 1986;
/// for ICP Fusiello et al. 2002).
///
/// Keeps d ≤ med + factor·max(1.4826·MAD, floor), with MAD the median of |d − med|. Pairs that are closer than the median
/// are never outliers. The floor keeps what is spread by less than the sensor resolves; without one, a well aligned object
/// whose distances are nearly all equal would lose every pair that is a rounding error further. Distances that are not
/// finite count for nothing and go. Cost: O(pairs).
#[derive(Clone, Debug, PartialEq)]
pub struct MadDistance {
    /// Standard deviations beyond the median; NaN removes every pair.
    pub factor: f32,
    /// Smallest standard deviation assumed, metres; NaN and negative values count as 0.
    pub floor: f32,
    distances: Scratch<Vec<f32>>,
}

impl MadDistance {
    /// Makes the filter; the floor is in metres.
    #[must_use]
    pub fn new(factor: f32, floor: f32) -> Self {
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
        let center = median(distances).unwrap_or(0.0);
        for distance in &mut *distances {
            *distance = (*distance - center).abs();
        }
        let deviation = SIGMA_PER_MAD * median(distances).unwrap_or(0.0);
        keep_within(
            pairs,
            center + self.factor * deviation.max(self.floor.max(0.0)),
        );
    }

    fn name(&self) -> &'static str {
        "mad-distance"
    }
}
