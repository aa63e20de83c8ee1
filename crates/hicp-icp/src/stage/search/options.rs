//! The range, budget and conditions of a search.

use std::time::Duration;

use crate::stage::search::hypotheses::Rotations;
use crate::stop::motion::Bound;

/// The use of the initial pose by a [`HypothesisSearch`](crate::HypothesisSearch).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Start {
    /// The local stage refines it, and the search starts if the score stays bad.
    #[default]
    Refined,
    /// It is ignored: the search always runs, and all hypotheses come from the image.
    ///
    /// It may be any finite pose, for example the identity. It is returned only if nothing was
    /// observed or nothing was found. A bound, and other rotations than [`Rotations::Even`], still
    /// refer to it.
    Ignored,
}

/// The range, budget and conditions of a [`HypothesisSearch`](crate::HypothesisSearch).
///
/// Any value is valid: with a value out of range, nothing is searched or nothing better is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// The use of the initial pose.
    pub start: Start,
    /// The doubt above which the search starts.
    ///
    /// If the local stage ends at or below it, only poses that look like the local one are tried.
    pub threshold: f64,
    /// The score at or below which the search does not start, however doubtful the pose is.
    ///
    /// Depth images of real sensors have errors that raise the doubt in right poses.
    pub least_score: f64,
    /// The doubt at which no further hypotheses are refined.
    pub good_enough: f64,
    /// The gain in score by which a hypothesis must beat the local pose to replace it.
    ///
    /// Poses with a smaller gap may be ambiguous, so the one near the initial pose is kept. A pose
    /// that is still doubtful (above 0.1) must gain 2.5 times as much.
    pub min_gain: f64,
    /// The rotations to try, next to the neighbors of the initial pose.
    pub rotations: Rotations,
    /// Number of these rotations.
    pub hypotheses: usize,
    /// Number of best ranked hypotheses to align.
    pub aligned: usize,
    /// Number of best aligned hypotheses to refine, and a third as many look-alikes of the best.
    pub refined: usize,
    /// The smallest angle between the rotations of refined hypotheses, degrees.
    ///
    /// Of two that are nearer, the better ranked one is kept. 0 removes only exact duplicates.
    pub spacing_degrees: f64,
    /// The largest distance of the result from the initial pose; `None` for no limit.
    pub bound: Option<Bound>,
    /// The longest time of a run. At the limit, the best pose so far is returned with
    /// [`Termination::Deadline`](crate::Termination::Deadline).
    ///
    /// Results then depend on the clock; `hypotheses`, `aligned` and `refined` are budgets that do
    /// not. The clock is read between hypotheses, so a run exceeds the limit by at most one of
    /// them.
    pub time_limit: Option<Duration>,
}

impl Default for SearchOptions {
    /// 1000 rotations of SO(3), without a bound.
    ///
    /// Of these, 256 are aligned, and 24 at least 20° apart are refined.
    ///
    /// The search starts above a doubt of 0.05 and a score of 0.05. A hypothesis must be better by
    /// a score of 0.02, and not be more doubtful.
    fn default() -> Self {
        Self {
            start: Start::Refined,
            threshold: 0.05,
            least_score: 0.05,
            good_enough: 0.02,
            min_gain: 0.02,
            rotations: Rotations::Even,
            hypotheses: 1000,
            aligned: 256,
            refined: 24,
            spacing_degrees: 20.0,
            bound: None,
            time_limit: None,
        }
    }
}
