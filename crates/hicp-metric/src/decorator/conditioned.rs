//! A metric with a policy for degenerate directions.

use hicp_core::{Correspondences, Iteration};

use crate::metric::minimize::Minimize;
use crate::system::degeneracy::Degeneracy;
use crate::system::normal_equations::NormalEquations;

/// Solves the normal equations of a metric with a chosen [`Degeneracy`] policy.
///
/// The step is that of Gauss–Newton, even for metrics with a closed form. Cost of `Freeze` and
/// `Refuse`: an eigendecomposition of a 6×6 matrix per step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditioned<M> {
    /// The metric to minimize.
    pub metric: M,
    /// The treatment of degenerate directions.
    ///
    /// The default is [`Degeneracy::Freeze`], since metrics use `Damp` without this decorator.
    pub policy: Degeneracy,
    /// Largest eigenvalue of a degenerate direction, relative to the largest of the scaled JᵀWJ.
    ///
    /// The default is [`Degeneracy::THRESHOLD`], 10⁻³.
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

    fn system_and_loss(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<(NormalEquations, f64)> {
        let (system, mean_loss) = self.metric.system_and_loss(iteration, pairs)?;
        Some((system.with_policy(self.policy, self.threshold), mean_loss))
    }

    fn label(&self) -> &'static str {
        "conditioned"
    }
}
