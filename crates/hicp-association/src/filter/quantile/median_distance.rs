//! Rejection by a multiple of the median distance.

use hicp_core::internal::{Scratch, median};
use hicp_core::{Correspondences, Iteration};

use crate::filter::max_distance::keep_within;
use crate::filter::outlier_filter::OutlierFilter;
use crate::filter::quantile::distances::collect_finite;
use crate::length::narrow;

/// Removes pairs further apart than `factor` times the median distance.
///
/// Source: Diebel, Reutersward, Thrun, Davis & Gupta 2004. The limit follows the alignment without
/// a length parameter: it is generous while the object is far away, and strict in the end. Pairs at
/// the limit are kept, so with a factor of 1 or more, equal distances are all kept. Of an even
/// number of values, the median is the upper of the two middle ones. Distances that are not finite
/// are ignored, and their pairs are removed. Cost: O(pairs).
#[derive(Clone, Debug, PartialEq)]
pub struct MedianDistance {
    /// Largest distance, divided by the median. NaN and negative values remove every pair.
    pub factor: f64,
    distances: Scratch<Vec<f32>>,
}

impl MedianDistance {
    /// Creates the filter.
    #[must_use]
    pub fn new(factor: f64) -> Self {
        Self {
            factor,
            distances: Scratch::default(),
        }
    }
}

impl Default for MedianDistance {
    /// Three times the median.
    fn default() -> Self {
        Self::new(3.0)
    }
}

impl OutlierFilter for MedianDistance {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let distances = &mut self.distances.0;
        collect_finite(pairs, distances);
        keep_within(
            pairs,
            narrow(self.factor) * median(distances, f32::total_cmp).unwrap_or(0.0),
        );
    }

    fn name(&self) -> &'static str {
        "median-distance"
    }
}
