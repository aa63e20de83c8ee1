//! Rejection of a fixed share.

use hicp_core::internal::Scratch;
use hicp_core::{Correspondences, Iteration};

use crate::filter::max_distance::keep_within;
use crate::filter::outlier_filter::OutlierFilter;
use crate::filter::quantile::distances::{collect_finite, nth_smallest, share_of};

/// Keeps the closest share of the pairs (trimmed ICP, Chetverikov et al. 2002).
///
/// The limit is the ⌈keep·n⌉-th smallest of the n finite distances. Ties with it are kept, too, so
/// the result does not depend on the order of the pairs. Pairs whose distance is not finite are
/// removed. Cost: O(pairs).
#[derive(Clone, Debug, PartialEq)]
pub struct Trimmed {
    /// The kept share: the expected overlap.
    ///
    /// 1 or more keeps all. 0, negative values and NaN remove every pair.
    pub keep: f64,
    distances: Scratch<Vec<f32>>,
}

impl Trimmed {
    /// Creates the filter.
    #[must_use]
    pub fn new(keep: f64) -> Self {
        Self {
            keep,
            distances: Scratch::default(),
        }
    }
}

impl Default for Trimmed {
    /// Keeps 85 %.
    fn default() -> Self {
        Self::new(0.85)
    }
}

impl OutlierFilter for Trimmed {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let distances = &mut self.distances.0;
        collect_finite(pairs, distances);
        let limit = share_of(self.keep, distances.len())
            .checked_sub(1)
            .and_then(|rank| nth_smallest(distances, rank));
        keep_within(pairs, limit.unwrap_or(f32::NAN));
    }

    fn name(&self) -> &'static str {
        "trimmed"
    }
}
