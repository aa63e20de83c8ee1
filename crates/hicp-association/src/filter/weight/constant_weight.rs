//! One weight for all pairs.

use hicp_core::{Correspondences, Iteration};

use crate::filter::outlier_filter::OutlierFilter;
use crate::length::narrow;

/// Multiplies every weight by a constant.
///
/// It changes neither the step of a single metric nor the mean loss, which is a weighted mean. It
/// changes the information of the pairs, and so their influence relative to terms without these
/// weights, such as a `PosePrior`. Cost: O(pairs).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantWeight {
    /// The factor. Negative values, NaN and infinity count as 0.
    pub weight: f64,
}

impl Default for ConstantWeight {
    /// 1, which changes nothing.
    fn default() -> Self {
        Self { weight: 1.0 }
    }
}

impl OutlierFilter for ConstantWeight {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let weight = narrow(self.weight).max(0.0);
        let weight = if weight.is_finite() { weight } else { 0.0 };
        for pair in pairs.as_mut_slice() {
            pair.weight *= weight;
        }
    }

    fn name(&self) -> &'static str {
        "constant-weight"
    }
}
