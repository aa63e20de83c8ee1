//! Metrics that change from iteration to iteration.

use hicp_core::{Correspondences, Isometry3, Pair};

use crate::metric::error_metric::{ErrorMetric, Step};
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
    iteration: usize,
}

impl<M> MetricSchedule<M> {
    /// Makes the schedule.
    #[must_use]
    pub fn new(metrics: Vec<M>) -> Self {
        Self {
            metrics,
            iteration: 0,
        }
    }

    fn index(&self) -> usize {
        self.iteration.min(self.metrics.len().saturating_sub(1))
    }

    fn current(&mut self) -> Option<&mut M> {
        let index = self.index();
        self.metrics.get_mut(index)
    }
}

impl<M: ErrorMetric> ErrorMetric for MetricSchedule<M> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        if let Some(metric) = self.metrics.get(self.index()) {
            metric.linearize(pair, system);
        }
    }

    fn squared_error(&self, pair: &Pair) -> f64 {
        let metric = self.metrics.get(self.index());
        metric.map_or(0.0, |metric| metric.squared_error(pair))
    }

    fn mean_loss(&mut self, pairs: &Correspondences) -> Option<f64> {
        self.current()?.mean_loss(pairs)
    }

    fn system(&mut self, pairs: &Correspondences) -> Option<NormalEquations> {
        self.current()?.system(pairs)
    }

    fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
        self.current()?.minimize(pairs)
    }

    fn begin(&mut self, iteration: usize, init: &Isometry3<f64>) {
        self.iteration = iteration;
        for metric in &mut self.metrics {
            metric.begin(iteration, init);
        }
    }

    fn name(&self) -> &'static str {
        "metric-schedule"
    }
}
