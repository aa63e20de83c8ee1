//! A floor for the number of pairs.

use hicp_core::{Correspondences, Iteration};

use crate::filter::outlier_filter::OutlierFilter;

/// Removes all pairs when there are fewer than `count`, so that the stage ends with "no pairs" at the pose accepted last.
///
/// Few pairs fit any pose. Goes last in a chain: it counts what the filters before it have left. Cost: constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MinPairs {
    /// Fewest pairs that a step is taken from; 0 and 1 never remove anything.
    pub count: usize,
}

impl Default for MinPairs {
    /// Six: with fewer, point-to-plane pairs cannot determine six degrees of freedom.
    fn default() -> Self {
        Self { count: 6 }
    }
}

impl OutlierFilter for MinPairs {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        if pairs.len() < self.count {
            pairs.retain(|_| false);
        }
    }

    fn name(&self) -> &'static str {
        "min-pairs"
    }
}
