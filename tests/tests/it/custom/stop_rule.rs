//! A custom stop rule: patience.

use hicp_testkit::{StopRuleLaws, check_stop_rule};
use hicp_tests::starts::{measure_stage, starts};
use hybrid_icp::association::{Projective, VisibleSurface};
use hybrid_icp::core::Iteration;
use hybrid_icp::icp::Judgment;
use hybrid_icp::icp::{Icp, IterationLimit, Progress, Stage, StopRule, Termination};
use hybrid_icp::metric::PointToPlane;

// --- The component ---

/// Ends a stage as converged if the lowest loss has not improved for a number of iterations.
///
/// An improvement is a relative gain of at least a limit. The loss of projective association rises
/// and falls on its way; this rule gives it time.
#[derive(Clone, Copy, Debug)]
struct Patience {
    turns: usize,
    gain: f64,
    best: f64,
    waited: usize,
}

impl Patience {
    fn new(turns: usize, gain: f64) -> Self {
        let (best, waited) = (f64::INFINITY, 0);
        Self {
            turns,
            gain,
            best,
            waited,
        }
    }
}

impl StopRule for Patience {
    fn start(&mut self) {
        *self = Self::new(self.turns, self.gain);
    }

    fn check(&mut self, _iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        let loss = progress.current.mean_loss;
        if loss < self.best * (1.0 - self.gain) {
            (self.best, self.waited) = (loss, 0);
        } else {
            self.waited += 1;
        }
        if self.waited >= self.turns {
            return Judgment::Accept(Termination::Custom("out_of_patience"));
        }
        Judgment::Continue
    }
}

// --- Its tests ---

fn projective<S: StopRule>(stop: S) -> impl Stage {
    Icp {
        selection: VisibleSurface::default(),
        association: Projective,
        filter: (),
        metric: PointToPlane,
        stop,
    }
}

#[test]
fn it_keeps_the_laws() {
    check_stop_rule(|| Patience::new(3, 0.01), StopRuleLaws::default());
}

#[test]
fn it_ends_soon_and_loses_little() {
    let starts = starts(2, 0.5);
    let full = measure_stage(&mut projective(IterationLimit(50)), &starts);
    let rule = (Patience::new(3, 0.01), IterationLimit(50));
    let mine = measure_stage(&mut projective(rule), &starts);
    assert_eq!(full.iterations, 50.0);
    assert!(mine.iterations < 25.0, "{mine:?}\n{full:?}");
    assert!(mine.degrees < 1.25 * full.degrees, "{mine:?}\n{full:?}");
}
