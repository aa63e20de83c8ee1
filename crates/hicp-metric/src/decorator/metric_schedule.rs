//! Metrics that change from iteration to iteration.

use hicp_core::{Correspondences, Iteration};

use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;

/// Selects one metric per iteration: the k-th in the k-th iteration of a stage, then the last.
///
/// A kernel with a decreasing scale starts almost convex and ends selective (graduated
/// non-convexity: Blake & Zisserman 1987). An example is [`Robust`](crate::Robust) with
/// [`Scale::Meters`](crate::Scale::Meters) of 20 mm, 10 mm and 5 mm.
///
/// During the schedule, stop rules that compare losses receive those of different metrics. Make
/// them lenient, or use rules on the motion. Without metrics, there is no step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MetricSchedule<M> {
    /// The metrics by iteration.
    pub metrics: Vec<M>,
}

impl<M> MetricSchedule<M> {
    /// Creates the schedule.
    #[must_use]
    pub fn new(metrics: Vec<M>) -> Self {
        Self { metrics }
    }
}

impl<M: Minimize> Minimize for MetricSchedule<M> {
    fn inner(&mut self, iteration: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        let last = self.metrics.len().saturating_sub(1);
        let metric = self.metrics.get_mut(iteration.index.min(last))?;
        Some(metric)
    }

    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        self.inner(iteration)?.minimize(iteration, pairs)
    }

    fn label(&self) -> &'static str {
        "metric-schedule"
    }
}
