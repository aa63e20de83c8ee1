//! A lower limit for the number of pairs.

use hicp_core::{Correspondences, Iteration};

use crate::filter::outlier_filter::OutlierFilter;

/// Removes all pairs if there are fewer than `count`, so that the stage ends with "no pairs".
///
/// Few pairs fit any pose. The stage then returns the pose accepted last. Use it last in a chain,
/// because it counts the pairs that the filters before it keep. Cost: O(1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MinPairs {
    /// Smallest number of pairs for a step. 0 and 1 never remove anything.
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
