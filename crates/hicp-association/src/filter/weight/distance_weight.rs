//! Weights that fall with the distance.

use hicp_core::{Correspondences, Iteration};

use crate::filter::max_distance::keep_within;
use crate::filter::outlier_filter::OutlierFilter;
use crate::length::Length;

/// Multiplies weights by 1 − d/d_max, and by 0 from d_max on (Godin, Rioux & Baribeau 1994).
///
/// d_max is a fixed length and not the largest distance found, which would set the weight of equal
/// distances to 0. Pairs of weight 0 stay in the list. Only pairs whose distance is not finite are
/// removed. Cost: O(pairs).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceWeight {
    /// Distance d_max from which on weights are 0. With 0, negative values and NaN, all weights are
    /// 0.
    pub max: Length,
}

impl Default for DistanceWeight {
    /// A quarter of the diameter.
    fn default() -> Self {
        Self {
            max: Length::Diameters(0.25),
        }
    }
}

impl OutlierFilter for DistanceWeight {
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let max = self.max.meters(&iteration.problem);
        keep_within(pairs, f32::INFINITY);
        for pair in pairs.as_mut_slice() {
            let distance = pair.distance();
            // Compare first, because the quotient of two zeros is not a number.
            pair.weight *= if distance < max {
                1.0 - distance / max
            } else {
                0.0
            };
        }
    }

    fn name(&self) -> &'static str {
        "distance-weight"
    }
}
