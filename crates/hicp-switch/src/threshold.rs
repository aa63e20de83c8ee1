//! Switching by thresholds on a score.

use hicp_core::{Context, Isometry3, Problem};
use hicp_icp::{Regime, RegimeEvent};
use hicp_score::Score;

use crate::switcher::Switcher;

/// Selects misaligned if a score is at least α, otherwise aligned.
///
/// With the MVE as the score, it is Dynamic Switching (§IV-A).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold<S> {
    /// The score; higher is worse.
    pub score: S,
    /// The threshold; the paper's is [`PAPER_ALPHA`].
    pub alpha: f64,
}

/// The threshold on the MVE that generalizes according to the paper (§IV-A.2).
pub const PAPER_ALPHA: f64 = 0.4;

/// The paper's threshold on the default score.
impl<S: Default> Default for Threshold<S> {
    fn default() -> Self {
        Self {
            score: S::default(),
            alpha: PAPER_ALPHA,
        }
    }
}

impl<S: Score> Switcher for Threshold<S> {
    fn regime(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
    ) -> RegimeEvent {
        let score = self.score.score(context, camera_from_object);
        RegimeEvent {
            regime: if score >= self.alpha {
                Regime::MISALIGNED
            } else {
                Regime::ALIGNED
            },
            score: Some(score),
        }
    }

    fn name(&self) -> &'static str {
        "threshold"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.score.unsupported(problem)
    }
}

/// Selects among any number of regimes by thresholds on a score.
///
/// It is regime k if exactly k of the bounds are at or below the score. With one bound it equals
/// [`Threshold`].
#[derive(Clone, Debug, PartialEq)]
pub struct Thresholds<S> {
    /// The score; higher is worse.
    pub score: S,
    /// The bounds, in any order.
    pub bounds: Vec<f64>,
}

impl<S: Score> Switcher for Thresholds<S> {
    fn regime(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
    ) -> RegimeEvent {
        let score = self.score.score(context, camera_from_object);
        RegimeEvent {
            regime: Regime(self.bounds.iter().filter(|bound| score >= **bound).count()),
            score: Some(score),
        }
    }

    fn name(&self) -> &'static str {
        "thresholds"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.score.unsupported(problem)
    }
}
