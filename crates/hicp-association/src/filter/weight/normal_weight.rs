//! Weights that fall with the angle between normals.

use hicp_core::{Correspondences, Iteration};

use crate::filter::outlier_filter::OutlierFilter;

/// Multiplies weights by n·m, the cosine of the angle between the two normals.
///
/// Source: Rusinkiewicz & Levoy 2001, §3.3. Beyond a right angle, the weight becomes 0. Pairs of
/// weight 0 stay in the list. Cost: O(pairs).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NormalWeight;

impl OutlierFilter for NormalWeight {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        for pair in pairs.as_mut_slice() {
            let cosine = pair.source.normal.dot(&pair.target.normal);
            // False for NaN. Rounding may put a cosine just above 1.
            pair.weight *= if cosine > 0.0 { cosine.min(1.0) } else { 0.0 };
        }
    }

    fn name(&self) -> &'static str {
        "normal-weight"
    }
}
