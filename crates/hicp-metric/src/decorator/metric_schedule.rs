//! Metrics that change from iteration to iteration.

use hicp_core::{Correspondences, Iteration};

use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;

/// One metric per iteration: the k-th in the k-th iteration of a stage, and the last from then on.
///
/// A kernel whose scale falls ([`crate::Robust`] with [`crate::Scale::Meters`] of 20 mm, 10 mm, 5 mm) starts almost convex and
/// ends selective (graduated non-convexity: Blake & Zisserman 1987). Rules that compare losses see those of different metrics
/// while the schedule lasts: let them be lenient, or end on the motion. Without metrics no step is determined.
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
