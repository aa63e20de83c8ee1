//! Weights that fall with the distance.

use hicp_core::{Correspondences, Iteration};

use crate::filter::max_distance::keep_within;
use crate::filter::outlier_filter::OutlierFilter;
use crate::length::Length;

/// Multiplies weights by 1 − d/d_max, and by 0 from d_max on (Godin, Rioux & Baribeau 1994).
///
/// d_max is a length of its own rather than the largest distance found: with that, equal distances would all weigh nothing.
/// Pairs of weight 0 stay in the list; only those at a distance that is not finite go. Cost: O(pairs).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceWeight {
    /// Distance d_max from which on pairs weigh nothing. For 0, negative values and NaN none weighs anything.
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
            // Compared first: the quotient of two zeros is no number.
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
