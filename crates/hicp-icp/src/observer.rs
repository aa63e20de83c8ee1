//! The observer of a run, and the events that it receives.

use std::ops::ControlFlow;

use hicp_core::internal::for_tuples;
use hicp_core::{Correspondences, Isometry3};

use crate::outcome::{Evaluation, Outcome};

/// Observes a run. All methods do nothing unless overridden.
///
/// They are called per iteration, per scored pose or per stage, never per point. A tuple of up to
/// eight observers passes every event to all of them, and breaks if one breaks.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an observer",
    label = "this must implement `Observer`",
    note = "`Session::new` and `refine_observed` accept `&mut` of an `Observer`; `&mut ()` observes nothing"
)]
pub trait Observer {
    /// Receives an evaluated pose. `Break` ends the run there, with
    /// [`Termination::Stopped`](crate::Termination::Stopped).
    ///
    /// No other part of a composed stage runs then. It is called before the stop rules judge the
    /// pose. If one rejects it, the run returns the pose before it.
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        let _ = event;
        ControlFlow::Continue(())
    }

    /// Receives the choice of a switcher.
    fn on_regime(&mut self, event: &RegimeEvent) {
        let _ = event;
    }

    /// Receives the decision of a stage about a pose that it scored.
    ///
    /// [`Guard`](crate::Guard), [`KeepBest`](crate::KeepBest), `SwitchUntilStall` and
    /// [`HypothesisSearch`](crate::HypothesisSearch) report them.
    fn on_decision(&mut self, event: &DecisionEvent<'_>) {
        let _ = event;
    }

    /// Receives the outcome of an ICP stage. Composed stages report through their parts.
    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        let _ = event;
    }
}

/// Observes nothing.
impl Observer for () {}

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<T: Observer + ?Sized> Observer for $pointer {
            fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
                (**self).on_iteration(event)
            }

            fn on_regime(&mut self, event: &RegimeEvent) {
                (**self).on_regime(event);
            }

            fn on_decision(&mut self, event: &DecisionEvent<'_>) {
                (**self).on_decision(event);
            }

            fn on_stage_end(&mut self, event: &StageEvent<'_>) {
                (**self).on_stage_end(event);
            }
        }
    )+};
}
forward!(Box<T>, &mut T);

macro_rules! all {
    ($($member:ident),+) => {
        #[allow(non_snake_case)]
        impl<$($member: Observer),+> Observer for ($($member,)+) {
            fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
                let ($($member,)+) = self;
                // Call all of them, also after one that breaks.
                $(let $member = $member.on_iteration(event);)+
                $($member?;)+
                ControlFlow::Continue(())
            }

            fn on_regime(&mut self, event: &RegimeEvent) {
                let ($($member,)+) = self;
                $($member.on_regime(event);)+
            }

            fn on_decision(&mut self, event: &DecisionEvent<'_>) {
                let ($($member,)+) = self;
                $($member.on_decision(event);)+
            }

            fn on_stage_end(&mut self, event: &StageEvent<'_>) {
                let ($($member,)+) = self;
                $($member.on_stage_end(event);)+
            }
        }
    };
}
for_tuples!(all);

/// An evaluated pose.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct IterationEvent<'a> {
    /// Iteration within the stage, from 0.
    pub iteration: usize,
    /// The evaluated pose.
    pub camera_from_object: &'a Isometry3<f64>,
    /// Its number of pairs and loss.
    pub evaluation: Evaluation,
    /// The increment computed at this pose.
    pub increment: &'a Isometry3<f64>,
    /// The pairs at this pose, after filtering; `None` if a custom stage does not set them.
    pub pairs: Option<&'a Correspondences>,
}

impl<'a> IterationEvent<'a> {
    /// Creates the event of an evaluated pose, for a custom stage; see [`Stage`](crate::Stage).
    #[must_use]
    pub fn new(
        iteration: usize,
        camera_from_object: &'a Isometry3<f64>,
        evaluation: Evaluation,
        increment: &'a Isometry3<f64>,
    ) -> Self {
        Self {
            iteration,
            camera_from_object,
            evaluation,
            increment,
            pairs: None,
        }
    }
}

/// The regime of a pose: the index of the branch that a switch runs, from 0.
///
/// The better the pose agrees with the image, the lower the regime. The paper has two,
/// [`Regime::ALIGNED`] and [`Regime::MISALIGNED`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Regime(pub usize);

impl Regime {
    /// The estimate agrees with the image: projective association finds consistent pairs.
    pub const ALIGNED: Self = Self(0);
    /// The estimate does not agree with the image: only nearest neighbors find pairs.
    pub const MISALIGNED: Self = Self(1);

    /// Returns the name in traces and files.
    ///
    /// Branch 1 is "misaligned" even if there are more than two branches, such as those of
    /// `SwitchAmong`.
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

/// The choice of a switcher.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RegimeEvent {
    /// The selected branch.
    pub regime: Regime,
    /// The score that decided, if there is one.
    pub score: Option<f64>,
}

/// The decision of a stage whether it keeps a pose that it scored.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DecisionEvent<'a> {
    /// Name of the stage that decides.
    pub stage: &'static str,
    /// The scored pose.
    pub camera_from_object: &'a Isometry3<f64>,
    /// Its score; lower is better.
    pub score: f64,
    /// The score of the best pose before it; infinity if there was none.
    pub best: f64,
    /// `true` if the stage keeps the pose, `false` if it rejects it.
    pub kept: bool,
}

impl<'a> DecisionEvent<'a> {
    /// Creates the decision of a custom stage.
    #[must_use]
    pub fn new(
        stage: &'static str,
        camera_from_object: &'a Isometry3<f64>,
        score: f64,
        best: f64,
        kept: bool,
    ) -> Self {
        Self {
            stage,
            camera_from_object,
            score,
            best,
            kept,
        }
    }
}

/// The end of an ICP stage.
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
    /// Number of selected points.
    pub n_source: usize,
    /// The result of the stage.
    pub outcome: &'a Outcome,
}

impl<'a> StageEvent<'a> {
    /// Creates the end of a custom stage without points and with "none" as the name of all
    /// components; set the fields that it has.
    #[must_use]
    pub fn new(outcome: &'a Outcome) -> Self {
        Self {
            selection: "none",
            association: "none",
            filters: &[],
            metric: "none",
            stop_rules: &[],
            n_source: 0,
            outcome,
        }
    }
}
