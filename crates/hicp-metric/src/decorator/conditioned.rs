//! A metric with a policy for degenerate directions.

use hicp_core::{Correspondences, Isometry3, Pair};

use crate::metric::error_metric::{ErrorMetric, Step};
use crate::system::degeneracy::Degeneracy;
use crate::system::normal_equations::NormalEquations;

/// A metric whose normal equations are solved with a [`Degeneracy`] policy of choice.
///
/// The step is Gauss–Newton's, also for metrics with a closed form. Cost of `Freeze` and `Refuse`: an eigen-decomposition of a
/// 6×6 matrix per step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditioned<M> {
    /// What is minimised.
    pub metric: M,
    /// What to do in degenerate directions; default [`Degeneracy::Freeze`], as `Damp` is what metrics do anyway.
    pub policy: Degeneracy,
    /// Largest ratio to the largest eigenvalue of the scaled JᵀWJ that is degenerate; default [`Degeneracy::THRESHOLD`], 10⁻³.
    pub threshold: f64,
}

impl<M: Default> Default for Conditioned<M> {
    fn default() -> Self {
        Self {
            metric: M::default(),
            policy: Degeneracy::Freeze,
            threshold: Degeneracy::THRESHOLD,
        }
    }
}

impl<M: ErrorMetric> ErrorMetric for Conditioned<M> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        self.metric.linearize(pair, system);
    }

    fn squared_error(&self, pair: &Pair) -> f64 {
        self.metric.squared_error(pair)
    }

    fn mean_loss(&mut self, pairs: &Correspondences) -> Option<f64> {
        self.metric.mean_loss(pairs)
    }

    fn system(&mut self, pairs: &Correspondences) -> Option<NormalEquations> {
        let system = self.metric.system(pairs)?;
        Some(system.with_policy(self.policy, self.threshold))
    }

    fn minimize(&mut self, pairs: &Correspondences) -> Option<Step> {
        Some(Step {
            increment: self.system(pairs)?.solve()?,
            mean_loss: self.mean_loss(pairs)?,
        })
    }

    fn begin(&mut self, iteration: usize, init: &Isometry3<f64>) {
        self.metric.begin(iteration, init);
    }

    fn name(&self) -> &'static str {
        "conditioned"
    }
}
