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
    /// The product of doubt and score above which the search starts.
    ///
    /// A doubtful pose may still explain the image well, because errors of real sensors raise the
    /// doubt. A doubt below 0.05 counts as 0.05. At or below the threshold, or if no pose can win
    /// by the gain, only poses that look like the local one are tried.
    pub threshold: f64,
    /// The threshold if the local pose is far from the initial one, or if that is ignored.
    pub far_threshold: f64,
    /// The doubt at which no further hypotheses are refined, unless the score is above 0.04. If the
    /// image does not decide among poses that look alike, the score must be at most 0.005.
    pub good_enough: f64,
    /// The gain by which a hypothesis must beat a local pose near the initial pose.
    ///
    /// Gains are in score + doubt / 10. A hypothesis must not be more doubtful, unless it halves
    /// the score and the doubt is below a half. Errors of sensors and meshes make wrong sides of
    /// cans and bowls better by up to 0.07, so the initial pose decides there. A hypothesis with a
    /// doubt of at most 0.02 needs no gain if its score is lower than that of every other pose by
    /// 0.01. A pose is near up to an MSSD of a quarter of the diameter.
    pub near_gain: f64,
    /// The gain by which it must beat a local pose far from the initial pose.
    ///
    /// As one of the two is wrong, the initial pose is then no evidence.
    pub far_gain: f64,
    /// The rotations to try, next to the neighbors of the initial pose.
    pub rotations: Rotations,
    /// Number of these rotations.
    pub hypotheses: usize,
    /// Number of best ranked hypotheses to align; a quarter if the local pose is near the initial
    /// one.
    pub aligned: usize,
    /// Number of best aligned hypotheses to refine; a quarter if the local pose is near the initial
    /// one.
    ///
    /// At most eight look-alikes of the best one are refined, and the finishing stage fits at most
    /// half as many poses as this.
    pub refined: usize,
    /// The smallest angle between the rotations of refined hypotheses, degrees.
    ///
    /// Of two that are nearer, the better ranked one is kept. 0 removes only exact duplicates.
    pub spacing_degrees: f64,
    /// Continues a search that has failed, unless the local pose is near the initial one.
    ///
    /// It then aligns all hypotheses, refines twice as many, and halves the spacing.
    pub widens: bool,
    /// The largest distance of the result from the initial pose; `None` for no limit.
    pub bound: Option<Bound>,
    /// The longest time of a run. At the limit, the best pose so far is returned with
    /// [`Termination::Deadline`](crate::Termination::Deadline).
    ///
    /// Results then depend on the clock; `hypotheses`, `aligned` and `refined` are budgets that do
    /// not. The clock is read between hypotheses, so a run exceeds the limit by at most one of
    /// them. Without an initial pose, the best one found by then is still fitted and refined.
    pub time_limit: Option<Duration>,
}

impl Default for SearchOptions {
    /// 1000 rotations of SO(3), without a bound.
    ///
    /// Of these, 256 are aligned, and 24 at least 20° apart are refined. Near the initial pose, it
    /// is a quarter of both.
    ///
    /// The search starts if doubt × score is above 0.002. A hypothesis must be better by 0.1. If
    /// the local pose is far from the initial one, the numbers are 0.001 and 0.04.
    fn default() -> Self {
        Self {
            start: Start::Refined,
            threshold: 0.002,
            far_threshold: 0.001,
            good_enough: 0.02,
            near_gain: 0.1,
            far_gain: 0.04,
            rotations: Rotations::Even,
            hypotheses: 1000,
            aligned: 256,
            refined: 24,
            spacing_degrees: 20.0,
            widens: true,
            bound: None,
            time_limit: None,
        }
    }
}

impl SearchOptions {
    /// Returns the options for a local pose near the initial one.
    ///
    /// Such a pose is rarely wrong, and a hypothesis must beat it by more.
    pub(crate) fn near(self) -> Self {
        Self {
            aligned: self.aligned.div_ceil(4),
            refined: self.refined.div_ceil(4),
            widens: false,
            ..self
        }
    }
}
