//! The laws of stages.

use std::ops::ControlFlow;

use hybrid_icp::core::{Isometry3, Problem, se3};
use hybrid_icp::icp::{IterationEvent, Observer, Outcome, Session, Stage, Verdict, Workspace};

use crate::law::{BOXED, PURE, Subject, bits};
use crate::scenes::{cases, sides, workspace};

/// What [`check_stage`] may take for granted of a stage beyond the trait's contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StageLaws {
    /// The observer hears of every pose evaluated, so that the one returned is among them. False for stages that evaluate
    /// without an engine of the library inside.
    pub tells_the_observer: bool,
}

impl Default for StageLaws {
    fn default() -> Self {
        Self {
            tells_the_observer: true,
        }
    }
}

/// Checks a [`Stage`]; `make` makes a fresh one.
///
/// # Laws
///
/// - Never panics; the pose is finite when the initial one is, and the initial one bit for bit when that is not finite or
///   nothing was observed.
/// - "Kept" is the initial pose bit for bit.
/// - Accept after evaluation: the returned pose was told to the observer, or is the initial one (see [`StageLaws`]).
/// - The numbers agree: an evaluation has pairs and a finite loss, and no more iterations are told than counted.
/// - Pure: a fresh and a used stage, with a fresh and a used workspace, give the same bits; so does a boxed one.
/// - An observer that stops at once gets an end all the same.
///
/// # Panics
///
/// Panics with the law, the input and what was found when a law is broken.
pub fn check_stage<T: Stage + 'static>(make: impl Fn() -> T, laws: StageLaws) {
    let subject = Subject::new::<T>(None);
    let (mut used, mut used_workspace) = (make(), workspace());
    for case in cases() {
        let input = case.label.as_str();
        let (expected, told) = subject.calm(input, || {
            run(&mut make(), &mut workspace(), &case.problem, &case.pose)
        });
        contract(&subject, input, laws, &case.pose, &expected, &told);
        if sides(&case.problem).1.n_surfels() == 0 {
            subject.same(
                "where nothing was observed the initial pose is returned bit for bit",
                input,
                &case.pose,
                &expected.camera_from_object,
            );
        }
        for _ in 0..2 {
            let (again, _) = subject.calm(input, || {
                run(&mut used, &mut used_workspace, &case.problem, &case.pose)
            });
            subject.same(PURE, input, &expected, &again);
        }
        let mut boxed: Box<dyn Stage> = Box::new(make());
        let (through_box, _) = subject.calm(input, || {
            run(&mut boxed, &mut workspace(), &case.problem, &case.pose)
        });
        subject.same(BOXED, input, &expected, &through_box);
        let stopped = subject.calm(input, || {
            let (mut workspace, mut observer) = (workspace(), Stopper);
            let mut session = Session::new(&mut workspace, &mut observer);
            make().run(&case.problem, &case.pose, &mut session)
        });
        finite(&subject, input, &case.pose, &stopped);
    }
}

/// The poses that an observer is told.
#[derive(Default)]
struct Told(Vec<Isometry3<f64>>);

impl Observer for Told {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        self.0.push(*event.camera_from_object);
        ControlFlow::Continue(())
    }
}

/// Stops at the first occasion.
struct Stopper;

impl Observer for Stopper {
    fn on_iteration(&mut self, _event: &IterationEvent<'_>) -> ControlFlow<()> {
        ControlFlow::Break(())
    }
}

fn run<S: Stage + ?Sized>(
    stage: &mut S,
    workspace: &mut Workspace,
    problem: &Problem<'_>,
    init: &Isometry3<f64>,
) -> (Outcome, Vec<Isometry3<f64>>) {
    let mut told = Told::default();
    let outcome = stage.run(problem, init, &mut Session::new(workspace, &mut told));
    (outcome, told.0)
}

fn finite(subject: &Subject, input: &str, init: &Isometry3<f64>, outcome: &Outcome) {
    let pose = &outcome.camera_from_object;
    if se3::is_finite(init) {
        subject.holds(
            "the pose is finite when the initial one is",
            input,
            se3::is_finite(pose),
            || format!("{outcome:?}"),
        );
    } else {
        subject.same(
            "an initial pose that is not finite is returned bit for bit",
            input,
            init,
            pose,
        );
    }
}

fn contract(
    subject: &Subject,
    input: &str,
    laws: StageLaws,
    init: &Isometry3<f64>,
    outcome: &Outcome,
    told: &[Isometry3<f64>],
) {
    finite(subject, input, init, outcome);
    let pose = bits(&outcome.camera_from_object);
    let kept = pose == bits(init);
    if matches!(outcome.verdict, Verdict::KeptInitial(_)) {
        let law = "a kept pose is the initial one bit for bit";
        subject.holds(law, input, kept, || format!("{outcome:?}"));
    }
    if laws.tells_the_observer {
        subject.holds(
            "accept after evaluation: the pose was told to the observer, or is the initial one",
            input,
            kept || told.iter().any(|evaluated| bits(evaluated) == pose),
            || format!("{outcome:?}, none of {} poses told", told.len()),
        );
        subject.holds(
            "no more iterations are told than counted",
            input,
            told.len() <= outcome.iterations,
            || format!("{} told, {} counted", told.len(), outcome.iterations),
        );
    }
    if let Some(evaluation) = outcome.evaluation {
        subject.holds(
            "an evaluation has pairs and a finite loss",
            input,
            evaluation.n_pairs > 0
                && evaluation.mean_loss.is_finite()
                && evaluation.mean_loss >= 0.0,
            || format!("{evaluation:?}"),
        );
        subject.holds(
            "the number of pairs is that of the evaluation",
            input,
            outcome.n_pairs() == evaluation.n_pairs,
            || format!("{outcome:?}"),
        );
    }
}
