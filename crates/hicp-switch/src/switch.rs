//! The stage that switches.

use hicp_core::{Isometry3, Problem};
use hicp_icp::{Outcome, Regime, Session, Stage};

use crate::switcher::Switcher;

/// Runs one of two stages, chosen from the image at the initial estimate: one iteration of Hybrid ICP (§IV-C).
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
        match event.regime {
            Regime::Aligned => self.aligned.run(problem, init, session),
            Regime::Misaligned => self.misaligned.run(problem, init, session),
        }
    }
}
