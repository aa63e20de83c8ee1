//! The divergence rules of Cascading ICP.

use hicp_core::Iteration;

use crate::outcome::Termination;
use crate::stop::stop_rule::{Judgment, Progress, StopRule};

/// The condition under which a rising mean loss counts as divergence (rule 3 of §IV-B).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum LossRule {
    /// Every rise above [`Divergence::rise_tolerance`], with more pairs or without.
    #[default]
    Strict,
    /// A rise without more pairs. New pairs have large residuals, and finding them is progress.
    CountAware,
}

/// Ends a stage that diverges, by the paper's three rules (§IV-B):
///
/// 1. There are no pairs ([`Termination::NoPairs`], which the engine itself detects).
/// 2. There are more than 5 % fewer pairs than at the first *or* the previous iteration.
/// 3. The mean loss rose since the previous iteration.
///
/// The stage then returns the last pose before it started to diverge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Divergence {
    /// Largest share of the pairs that may be lost.
    pub pairs_lost: f64,
    /// The condition of rule 3.
    pub loss_rule: LossRule,
    /// Relative rise of the mean loss that does not count, because the convergence rule covers it.
    // Deviation: tolerance of rule 3: §IV-B.2 ends a stage if the mean loss rises. As written, this
    // fires on a rise in the last digit, and every stage that converges would end as diverged. Here
    // a rise within the convergence threshold is convergence.
    pub rise_tolerance: f64,
}

impl Divergence {
    /// Creates the paper's rules, with a tolerance of 0.1 % for rule 3.
    ///
    /// Without the tolerance, a rise in the last digit would end nearly every stage as diverged.
    #[must_use]
    pub fn strict() -> Self {
        Self {
            pairs_lost: 0.05,
            loss_rule: LossRule::Strict,
            rise_tolerance: 1e-3,
        }
    }

    /// The paper's rules, with rule 3 only if the number of pairs did not grow.
    #[must_use]
    pub fn count_aware() -> Self {
        Self {
            loss_rule: LossRule::CountAware,
            ..Self::strict()
        }
    }
}

impl Default for Divergence {
    fn default() -> Self {
        Self::strict()
    }
}

impl StopRule for Divergence {
    fn check(&mut self, _iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        let Some(previous) = progress.previous else {
            return Judgment::Continue;
        };
        let n_pairs = progress.current.n_pairs;
        #[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
        let lost = |before: usize| (n_pairs as f64) < (1.0 - self.pairs_lost) * before as f64;
        if lost(progress.first.n_pairs) || lost(previous.n_pairs) {
            return Judgment::Reject(Termination::PairsLost);
        }
        let judged = match self.loss_rule {
            LossRule::Strict => true,
            LossRule::CountAware => n_pairs <= previous.n_pairs,
        };
        let rose = progress.current.mean_loss > previous.mean_loss * (1.0 + self.rise_tolerance);
        if judged && rose {
            return Judgment::Reject(Termination::LossIncreased);
        }
        Judgment::Continue
    }

    fn name(&self) -> &'static str {
        "divergence"
    }
}
