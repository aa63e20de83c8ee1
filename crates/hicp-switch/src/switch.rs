//! The stage that switches.

use hicp_core::{Isometry3, Problem};
use hicp_icp::{Outcome, Regime, Session, Stage, Termination};

use crate::switcher::Switcher;

/// Runs one of two stages, chosen from the image at the initial estimate: one iteration of Hybrid ICP (§IV-C).
///
/// Any regime but [`Regime::ALIGNED`] counts as misaligned; [`SwitchAmong`] takes more than two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Switch<W, A, M> {
    /// Who decides.
    pub switcher: W,
    /// What runs when the estimate agrees with the image.
    pub aligned: A,
    /// What runs when it does not.
    pub misaligned: M,
}

impl<W: Switcher, A: Stage, M: Stage> Stage for Switch<W, A, M> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let event = self
            .switcher
            .regime(&mut session.workspace.context(problem), init);
        session.observer.on_regime(&event);
        if event.regime == Regime::ALIGNED {
            self.aligned.run(problem, init, session)
        } else {
            self.misaligned.run(problem, init, session)
        }
    }

    fn name(&self) -> &'static str {
        "switch"
    }
}

/// Runs one of any number of stages, chosen from the image at the initial estimate.
///
/// Regime k runs the k-th stage, and any regime beyond the last one runs the last; without stages the initial pose is kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SwitchAmong<W, S> {
    /// Who decides.
    pub switcher: W,
    /// What runs, by regime.
    pub stages: Vec<S>,
}

impl<W: Switcher, S: Stage> Stage for SwitchAmong<W, S> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        let event = self
            .switcher
            .regime(&mut session.workspace.context(problem), init);
        session.observer.on_regime(&event);
        let last = self.stages.len().saturating_sub(1);
        match self.stages.get_mut(event.regime.0.min(last)) {
            Some(stage) => stage.run(problem, init, session),
            None => Outcome::kept(init, Termination::IterationLimit),
        }
    }

    fn name(&self) -> &'static str {
        "switch-among"
    }
}
