//! Filters that change from iteration to iteration.

use hicp_core::{Correspondences, Iteration, Problem};

use crate::filter::outlier_filter::OutlierFilter;

/// Applies one filter per iteration: the k-th in the k-th iteration of a stage, then the last.
///
/// A narrowing gate captures from far away and ends precisely. An example is
/// `Schedule::new(vec![MaxDistance::diameters(0.5), MaxDistance::diameters(0.1)])`. Zhang 1994
/// narrows by the distances found. Without filters, all pairs are kept.
///
/// The stop rule `Divergence` counts the pairs after the filters. It therefore ends a schedule that
/// removes more and more pairs, with `PairsLost`. Use `Convergence` and an `IterationLimit` without
/// it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Schedule<F> {
    /// The filters by iteration.
    pub filters: Vec<F>,
}

impl<F> Schedule<F> {
    /// Creates the schedule.
    #[must_use]
    pub fn new(filters: Vec<F>) -> Self {
        Self { filters }
    }
}

impl<F: OutlierFilter> OutlierFilter for Schedule<F> {
    fn filter(&mut self, iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let last = self.filters.len().saturating_sub(1);
        if let Some(filter) = self.filters.get_mut(iteration.index.min(last)) {
            filter.filter(iteration, pairs);
        }
    }

    fn name(&self) -> &'static str {
        "schedule"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.filters
            .iter()
            .find_map(|filter| filter.unsupported(problem))
    }
}
