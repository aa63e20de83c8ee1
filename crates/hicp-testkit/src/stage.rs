//! The laws of stages.

use std::ops::ControlFlow;

use hybrid_icp::core::{Isometry3, se3};
use hybrid_icp::icp::{
    IterationEvent, Observer, Outcome, Session, Stage, Termination, Verdict, Workspace,
};

use crate::law::{PURE, Subject, Trial, bits};
use crate::scenes::{Case, cases, sides, workspace};

/// The laws that [`check_stage`] checks beyond the contract of the trait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StageLaws {
    /// The observer receives every evaluated pose, so the returned pose is among them.
    ///
    /// False for stages that evaluate poses without an engine of the library.
    pub tells_the_observer: bool,
}

impl Default for StageLaws {
    fn default() -> Self {
        Self {
            tells_the_observer: true,
        }
    }
}

/// Checks a [`Stage`]; `make` creates a fresh one.
///
/// # Laws
///
/// - Never panics. If the initial pose is finite, the result is finite. If it is not, or if nothing
///   is observed, the result is the initial pose bit for bit.
/// - The verdict "kept" means the initial pose bit for bit.
/// - Accept after evaluation: the returned pose was reported to the observer or is the initial one
///   (see [`StageLaws`]).
/// - The numbers agree: an evaluation has pairs and a finite loss, and the observer receives at
///   most the counted iterations.
/// - Pure: a fresh, a used and a boxed stage give the same bits, with a fresh and with a used
///   workspace.
/// - If the observer stops the stage at the first, the second or the last iteration, the result is
///   valid, its reason is [`Termination::Stopped`], and the observer receives no other iteration.
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_stage<T: Stage + 'static>(make: impl Fn() -> T, laws: StageLaws) {
    let subject = Subject::new::<T>(None);
    let (mut used, mut boxed) = (make(), Box::new(make()) as Box<dyn Stage>);
    let mut used_workspace = workspace();
    for case in cases() {
        let trial = subject.on(&case.label);
        let init = &case.pose;
        let fresh = |stage: &mut (dyn Stage + 'static)| {
            let mut reported = Reported::default();
            let outcome = run(stage, &mut workspace(), &case, &mut reported);
            (outcome, reported.0)
        };
        let of_fresh = trial.calm(|| fresh(&mut make()));
        let (outcome, reported) = &of_fresh;
        contract(&trial, laws, init, outcome, reported);
        trial.pure::<dyn Stage, _>(&of_fresh, [&mut used, &mut boxed], fresh);
        let mut reported_again = Reported::default();
        let again = trial.calm(|| run(&mut used, &mut used_workspace, &case, &mut reported_again));
        trial.same(PURE, outcome, &again);
        if !sides(&case.problem).1.has_surface() {
            let law = "if nothing is observed, the initial pose is returned bit for bit";
            trial.same(law, init, &outcome.camera_from_object);
        }
        for at in [1, 2, reported.len().max(1)] {
            let mut stopper = Stopper { at, calls: 0 };
            let stopped = trial.calm(|| run(&mut make(), &mut workspace(), &case, &mut stopper));
            finite(&trial, init, &stopped);
            let ended = match stopper.calls {
                calls if calls < at => true,
                calls => calls == at && stopped.termination == Termination::Stopped,
            };
            let law = "a stage that the observer stops ends as `Stopped`, and runs nothing else";
            trial.holds(law, ended, format_args!("{stopped:?}"));
        }
    }
}

fn run(
    stage: &mut dyn Stage,
    workspace: &mut Workspace,
    case: &Case,
    observer: &mut dyn Observer,
) -> Outcome {
    let mut session = Session::new(workspace, observer);
    stage.run(&case.problem, &case.pose, &mut session)
}

/// The poses reported to an observer.
#[derive(Default)]
struct Reported(Vec<Isometry3<f64>>);

impl Observer for Reported {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        self.0.push(*event.camera_from_object);
        ControlFlow::Continue(())
    }
}

/// An observer that stops at one of its calls, and counts them.
struct Stopper {
    at: usize,
    calls: usize,
}

impl Observer for Stopper {
    fn on_iteration(&mut self, _event: &IterationEvent<'_>) -> ControlFlow<()> {
        self.calls += 1;
        if self.calls < self.at {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    }
}

fn finite(trial: &Trial<'_>, init: &Isometry3<f64>, outcome: &Outcome) {
    let pose = &outcome.camera_from_object;
    if se3::is_finite(init) {
        let law = "the pose is finite if the initial one is";
        trial.holds(law, se3::is_finite(pose), format_args!("{outcome:?}"));
    } else {
        let law = "an initial pose that is not finite is returned bit for bit";
        trial.same(law, init, pose);
    }
}

fn contract(
    trial: &Trial<'_>,
    laws: StageLaws,
    init: &Isometry3<f64>,
    outcome: &Outcome,
    reported: &[Isometry3<f64>],
) {
    finite(trial, init, outcome);
    let found = format_args!("{outcome:?}");
    let pose = bits(&outcome.camera_from_object);
    let kept = pose == bits(init);
    if matches!(outcome.verdict, Verdict::KeptInitial(_)) {
        let law = "a kept pose is the initial one bit for bit";
        trial.holds(law, kept, found);
    }
    if laws.tells_the_observer {
        trial.holds(
            "accept after evaluation: the pose was reported to the observer, or is the initial one",
            kept || reported.iter().any(|evaluated| bits(evaluated) == pose),
            format_args!("{outcome:?}, none of {} poses reported", reported.len()),
        );
        trial.holds(
            "no more iterations are reported than counted",
            reported.len() <= outcome.iterations,
            format_args!(
                "{} reported, {} counted",
                reported.len(),
                outcome.iterations
            ),
        );
    }
    if let Some(evaluation) = outcome.evaluation {
        let loss = evaluation.mean_loss;
        let valid = evaluation.n_pairs > 0 && loss.is_finite() && loss >= 0.0;
        trial.holds("an evaluation has pairs and a finite loss", valid, found);
        let agrees = outcome.n_pairs() == evaluation.n_pairs;
        let law = "the number of pairs is that of the evaluation";
        trial.holds(law, agrees, found);
    }
}
