//! Stages that select another stage.

use hicp_core::{Isometry3, Problem};
use hicp_icp::{Outcome, Regime, Session, Stage, Termination};

use crate::switcher::Switcher;

/// Runs one of two stages, selected from the image at the initial pose.
///
/// It is one iteration of Hybrid ICP (§IV-C). Any regime but [`Regime::ALIGNED`] counts as
/// misaligned; [`SwitchAmong`] accepts more than two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Switch<W, A, M> {
    /// Selects the regime.
    pub switcher: W,
    /// The stage for an estimate that agrees with the image.
    pub aligned: A,
    /// The stage for an estimate that does not agree with the image.
    pub misaligned: M,
}

impl<W: Switcher, A: Stage, M: Stage> Stage for Switch<W, A, M> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        if let Some(part) = self.switcher.unsupported(problem) {
            return Outcome::kept(init, Termination::Unsupported(part));
        }
        let event = self.switcher.regime(&mut session.context(problem), init);
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

/// Runs one of any number of stages, selected from the image at the initial pose.
///
/// Regime k runs the k-th stage, and regimes beyond the last stage run the last one. Without
/// stages, it keeps the initial pose.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SwitchAmong<W, S> {
    /// Selects the regime.
    pub switcher: W,
    /// The stages, by regime.
    pub stages: Vec<S>,
}

impl<W: Switcher, S: Stage> Stage for SwitchAmong<W, S> {
    fn run(
        &mut self,
        problem: &Problem<'_>,
        init: &Isometry3<f64>,
        session: &mut Session<'_>,
    ) -> Outcome {
        if let Some(part) = self.switcher.unsupported(problem) {
            return Outcome::kept(init, Termination::Unsupported(part));
        }
        let event = self.switcher.regime(&mut session.context(problem), init);
        session.observer.on_regime(&event);
        let last = self.stages.len().saturating_sub(1);
        match self.stages.get_mut(event.regime.0.min(last)) {
            Some(stage) => stage.run(problem, init, session),
            None => Outcome::kept(init, Termination::Kept),
        }
    }

    fn name(&self) -> &'static str {
        "switch-among"
    }
}
