//! The poses that a choice by color has compared.

use hicp_core::Isometry3;
use hicp_score::ColorEvidence;

use crate::outcome::Outcome;
use crate::stage::search::distinct::Distinct;

/// Correlation at which no other pose is tried.
const SURE: f64 = 0.8;
/// Correlation that a single cell might have by chance; it falls with the root of their number.
const CHANCE: f64 = 4.0;
/// Share of that correlation by which another pose must beat that of the stage.
const GAIN: f64 = 0.7;
/// Share of the gain that suffices for a pose that is nearly the same.
const SMALL_MOVE: f64 = 0.1;

/// A pose, its colors, and its score of the depth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measured {
    pub(crate) color: ColorEvidence,
    pub(crate) score: f64,
    pub(crate) outcome: Outcome,
}

impl Measured {
    pub(crate) fn pose(&self) -> &Isometry3<f64> {
        &self.outcome.camera_from_object
    }
}

/// The poses that explain the depth as well as that of the stage, with their colors.
pub(crate) struct Tried<'a> {
    pub(crate) distinct: &'a Distinct,
    pub(crate) least_correlation: f64,
    pub(crate) min_gain: f64,
    /// The pose of the stage.
    pub(crate) first: Measured,
    pub(crate) others: Vec<Measured>,
}

impl Tried<'_> {
    /// Iterates over all poses, that of the stage first.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Measured> {
        std::iter::once(&self.first).chain(&self.others)
    }

    /// Returns whether colors are evidence for a pose.
    pub(crate) fn agrees(&self, color: &ColorEvidence) -> bool {
        color.is_telling() && color.correlation >= self.least_correlation.max(by_chance(color))
    }

    /// Returns whether the colors of the chosen pose agree so well that no other is tried.
    pub(crate) fn is_sure(&self) -> bool {
        let color = &self.chosen().color;
        color.correlation > SURE && self.agrees(color)
    }

    /// Returns the pose that color chooses.
    pub(crate) fn chosen(&self) -> &Measured {
        self.other().unwrap_or(self.own())
    }

    /// Returns the pose of the stage, or one near it whose colors agree better.
    pub(crate) fn own(&self) -> &Measured {
        self.better(false, SMALL_MOVE).unwrap_or(&self.first)
    }

    /// Returns the pose apart from that of the stage whose colors agree best, if they agree clearly
    /// better than at the pose of the stage, and better than near it.
    pub(crate) fn other(&self) -> Option<&Measured> {
        let own = self.own().color.correlation;
        let other = self.better(true, 1.0);
        other.filter(|other| other.color.correlation > own)
    }

    /// Returns the pose whose colors agree best, among those apart from that of the stage or near
    /// it, if it gains a share of the usual gain.
    fn better(&self, apart: bool, share: f64) -> Option<&Measured> {
        let first = &self.first;
        let better = self.others.iter().filter(|found| {
            let gain = share * self.min_gain.max(GAIN * by_chance(&found.color));
            self.distinct.apart(found.pose(), first.pose()) == apart
                && self.agrees(&found.color)
                && found.color.correlation > first.color.correlation + gain
        });
        better.max_by(|a, b| a.color.correlation.total_cmp(&b.color.correlation))
    }
}

/// Returns the correlation that colors may have by chance: it is large for few cells.
fn by_chance(color: &ColorEvidence) -> f64 {
    CHANCE / (color.cells.max(1) as f64).sqrt()
}
