//! Stop rules on the loss.

use hicp_core::Iteration;

use crate::outcome::Termination;
use crate::stop::stop_rule::{Judgment, Progress, StopRule};

/// Ends a stage as converged if the mean loss has stopped changing.
///
/// It is the rule "terminated early if the ICP loss converges" of §IV-B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// Change of the mean loss, relative to the previous iteration, below which the stage has
    /// converged; default 10⁻³.
    pub relative_change: f64,
    /// Mean loss below which a change is rounding, m²; default 10⁻¹⁴.
    ///
    /// The default is the square of the resolution of `f32` at arm's length.
    pub negligible_loss: f64,
}

impl Default for Convergence {
    fn default() -> Self {
        Self {
            // Open: convergence of the loss: §IV-B.2. Relative change of the mean loss between
            // iterations. From 1e-2 to 1e-6, the accuracy is the same to two digits.
            relative_change: 1e-3,
            // Open: loss of an exact match: §IV-B.2. Below it (m²), changes are rounding.
            negligible_loss: 1e-14,
        }
    }
}

impl StopRule for Convergence {
    fn check(&mut self, _iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        let Some(previous) = progress.previous else {
            return Judgment::Continue;
        };
        let (before, now) = (previous.mean_loss, progress.current.mean_loss);
        let settled = (before - now).abs() < self.relative_change * before;
        Judgment::accept_if(
            settled || (before.max(now) <= self.negligible_loss),
            Termination::Converged,
        )
    }

    fn name(&self) -> &'static str {
        "convergence"
    }
}

/// Ends a stage as converged if the mean loss, or its change, is below an absolute limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AbsoluteLoss {
    /// Smallest change since the previous iteration, m².
    pub change: f64,
    /// Loss that ends the stage, m².
    pub good_enough: f64,
}

impl Default for AbsoluteLoss {
    /// The squares of a micrometer and of ten micrometers.
    fn default() -> Self {
        Self {
            change: 1e-12,
            good_enough: 1e-10,
        }
    }
}

impl StopRule for AbsoluteLoss {
    fn check(&mut self, _iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        let now = progress.current.mean_loss;
        let settled = progress
            .previous
            .is_some_and(|previous| (previous.mean_loss - now).abs() < self.change);
        Judgment::accept_if(settled || now < self.good_enough, Termination::Converged)
    }

    fn name(&self) -> &'static str {
        "absolute-loss"
    }
}
