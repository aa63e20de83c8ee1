//! Metrics that change from iteration to iteration.

use hicp_core::{Correspondences, Iteration};

use crate::metric::error_metric::Step;
use crate::metric::minimize::Minimize;
use crate::system::normal_equations::NormalEquations;

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

    fn current(&mut self, iteration: &Iteration<'_>) -> Option<&mut M> {
        let last = self.metrics.len().saturating_sub(1);
        self.metrics.get_mut(iteration.index.min(last))
    }
}

impl<M: Minimize> Minimize for MetricSchedule<M> {
    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        self.current(iteration)?.system(iteration, pairs)
    }

    fn mean_loss(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        self.current(iteration)?.mean_loss(iteration, pairs)
    }

    fn add_squared_errors(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
        factor: f64,
        errors: &mut [f64],
    ) {
        if let Some(metric) = self.current(iteration) {
            metric.add_squared_errors(iteration, pairs, factor, errors);
        }
    }

    fn minimize(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        self.current(iteration)?.minimize(iteration, pairs)
    }

    fn label(&self) -> &'static str {
        "metric-schedule"
    }
}
