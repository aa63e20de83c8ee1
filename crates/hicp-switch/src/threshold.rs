//! Switching on a score's threshold.

use hicp_core::{Context, Isometry3};
use hicp_icp::{Regime, RegimeEvent};
use hicp_score::Score;

use crate::switcher::Switcher;

/// Misaligned when a score is α or more, aligned below: Dynamic Switching with the MVE as the score (§IV-A).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Threshold<S> {
    /// The score, higher is worse.
    pub score: S,
    /// The threshold; the paper's is [`PAPER_ALPHA`].
    pub alpha: f64,
}

/// The threshold on the MVE that the paper found to generalise (§IV-A.2).
pub const PAPER_ALPHA: f64 = 0.4;

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
}

/// Any number of regimes by ascending thresholds on a score: regime k when exactly k of the bounds are at or below it.
///
/// With one bound it is [`Threshold`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Thresholds<S> {
    /// The score, higher is worse.
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
}
