//! A metric with a policy for degenerate directions.

use hicp_core::{Correspondences, Iteration};

use crate::metric::minimize::Minimize;
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

impl<M: Minimize> Minimize for Conditioned<M> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.metric)
    }

    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        let system = self.metric.system(iteration, pairs)?;
        Some(system.with_policy(self.policy, self.threshold))
    }

    fn label(&self) -> &'static str {
        "conditioned"
    }
}
