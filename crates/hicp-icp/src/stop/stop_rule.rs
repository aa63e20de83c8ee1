//! Stop rules: convergence, divergence and limits alike.

use std::ops::ControlFlow;

use hicp_core::Isometry3;

use crate::outcome::{Evaluation, Termination};

/// What a stop rule sees of an iteration.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Iteration within the stage, from 0.
    pub iteration: usize,
    /// Pairs and loss at the pose just evaluated.
    pub current: Evaluation,
    /// Those of the first iteration.
    pub first: Evaluation,
    /// Those of the iteration before; `None` at the first.
    pub previous: Option<Evaluation>,
    /// The pose just evaluated.
    pub camera_from_object: &'a Isometry3<f64>,
    /// The stage's initial pose.
    pub init: &'a Isometry3<f64>,
    /// The increment that the next iteration would apply.
    pub increment: &'a Isometry3<f64>,
}

/// Decides after every evaluation whether the stage goes on.
///
/// A termination for which [`Termination::is_rollback`] holds rejects the pose just evaluated, and the stage returns the
/// one accepted before it; any other accepts it. Tuples: all see every iteration, the first `Break` wins.
pub trait StopRule {
    /// Begins a stage; rules with memory forget.
    fn start(&mut self) {}

    /// Judges an iteration.
    fn check(&mut self, progress: &Progress<'_>) -> ControlFlow<Termination>;
}

impl<T: StopRule + ?Sized> StopRule for Box<T> {
    fn start(&mut self) {
        (**self).start();
    }

    fn check(&mut self, progress: &Progress<'_>) -> ControlFlow<Termination> {
        (**self).check(progress)
    }
}

/// As tuples: all see every iteration, the first `Break` wins.
impl<T: StopRule> StopRule for Vec<T> {
    fn start(&mut self) {
        self.iter_mut().for_each(StopRule::start);
    }

    fn check(&mut self, progress: &Progress<'_>) -> ControlFlow<Termination> {
        let mut verdict = ControlFlow::Continue(());
        for rule in self {
            let judged = rule.check(progress);
            if verdict.is_continue() {
                verdict = judged;
            }
        }
        verdict
    }
}

macro_rules! all_of {
    ($($member:ident),+) => {
        impl<$($member: StopRule),+> StopRule for ($($member,)+) {
            #[allow(non_snake_case)]
            fn start(&mut self) {
                let ($($member,)+) = self;
                $($member.start();)+
            }

            #[allow(non_snake_case)]
            fn check(&mut self, progress: &Progress<'_>) -> ControlFlow<Termination> {
                let ($($member,)+) = self;
                let mut verdict = ControlFlow::Continue(());
                $(
                    let judged = $member.check(progress);
                    if verdict.is_continue() {
                        verdict = judged;
                    }
                )+
                verdict
            }
        }
    };
}
all_of!(A);
all_of!(A, B);
all_of!(A, B, C);
all_of!(A, B, C, D);
all_of!(A, B, C, D, E);
all_of!(A, B, C, D, E, F);

/// Ends a stage after a number of evaluations, with the last one accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IterationLimit(pub usize);

impl Default for IterationLimit {
    /// 50; the divergence rules end nearly all stages long before.
    fn default() -> Self {
        Self(50)
    }
}

impl StopRule for IterationLimit {
    fn check(&mut self, progress: &Progress<'_>) -> ControlFlow<Termination> {
        if progress.iteration + 1 >= self.0 {
            ControlFlow::Break(Termination::IterationLimit)
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// Ends a stage when the mean loss has stopped changing ("terminated early if the ICP loss converges", §IV-B).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// Relative change of the mean loss against the previous iteration, up or down, below which the stage has converged.
    pub relative_change: f64,
    /// Mean loss (m²) below which there is nothing left to gain: the square of what `f32` resolves at arm's length.
    pub negligible_loss: f64,
}

impl Default for Convergence {
    fn default() -> Self {
        Self {
            relative_change: 1e-3,
            negligible_loss: 1e-14,
        }
    }
}

impl StopRule for Convergence {
    fn check(&mut self, progress: &Progress<'_>) -> ControlFlow<Termination> {
        let Some(previous) = progress.previous else {
            return ControlFlow::Continue(());
        };
        let (before, now) = (previous.mean_loss, progress.current.mean_loss);
        let settled = (before - now).abs() < self.relative_change * before;
        if settled || (before.max(now) <= self.negligible_loss) {
            ControlFlow::Break(Termination::Converged)
        } else {
            ControlFlow::Continue(())
        }
    }
}
