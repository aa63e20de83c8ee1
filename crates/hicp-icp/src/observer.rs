//! Who is told what happens during a run.

use std::ops::ControlFlow;

use hicp_core::Isometry3;

use crate::outcome::{Evaluation, Outcome};

/// Sees a run from outside. Called per iteration, never per point; all methods do nothing unless overridden.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an observer",
    label = "this must implement `Observer`",
    note = "`Session::new` and `refine_observed` accept `&mut` of an `Observer`; `&mut ()` observes nothing"
)]
pub trait Observer {
    /// An iteration evaluated a pose. `Break` ends the stage there, with [`crate::Termination::Stopped`], unless a stop rule
    /// rejects the pose; composed stages go on with what follows, and meet the same answer.
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        let _ = event;
        ControlFlow::Continue(())
    }

    /// A switcher chose.
    fn on_regime(&mut self, event: &RegimeEvent) {
        let _ = event;
    }

    /// An ICP stage ended. Composed stages report through their parts.
    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        let _ = event;
    }
}

/// Observes nothing.
impl Observer for () {}

/// An evaluated pose.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct IterationEvent<'a> {
    /// Iteration within the stage, from 0.
    pub iteration: usize,
    /// The pose evaluated.
    pub camera_from_object: &'a Isometry3<f64>,
    /// Its pairs and loss.
    pub evaluation: Evaluation,
    /// The increment found there.
    pub increment: &'a Isometry3<f64>,
}

/// Which branch of a switch is taken, counted from 0: the better the estimate agrees with the image, the lower.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Regime(pub usize);

impl Regime {
    /// The estimate agrees with the image: projective association finds consistent pairs.
    pub const ALIGNED: Self = Self(0);
    /// It does not: only nearest neighbours find pairs at all.
    pub const MISALIGNED: Self = Self(1);

    /// Name in traces and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self.0 {
            0 => "aligned",
            1 => "misaligned",
            2 => "regime-2",
            3 => "regime-3",
            _ => "regime-n",
        }
    }
}

/// A switcher's choice.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RegimeEvent {
    /// The branch taken.
    pub regime: Regime,
    /// The score that decided, if there is one.
    pub score: Option<f64>,
}

/// An ICP stage that ended.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct StageEvent<'a> {
    /// Name of the point selection.
    pub selection: &'static str,
    /// Name of the data association.
    pub association: &'static str,
    /// Names of the outlier filters and weights, in order.
    pub filters: &'a [&'static str],
    /// Name of the error metric.
    pub metric: &'static str,
    /// Names of the stop rules, in order.
    pub stop_rules: &'a [&'static str],
    /// Number of points selected.
    pub n_source: usize,
    /// What the stage returned.
    pub outcome: &'a Outcome,
}
