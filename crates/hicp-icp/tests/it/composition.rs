//! Tests of stages made of stages, and of the outcomes that they combine to.

use std::ops::ControlFlow;

use crate::script::support::{bits, pose};
use crate::script::{Line, Log, Scheduled, returned, run, run_observed, scripted};
use hicp_core::{Isometry3, Problem};
use hicp_icp::{
    Cascade, Divergence, Evaluation, IterationEvent, IterationLimit, Observer, Outcome, Regime,
    RegimeEvent, Repeat, Session, Stage, StageEvent, Termination, Verdict,
};

fn outcome(x: f64, verdict: Verdict, iterations: usize, loss: Option<f64>) -> Outcome {
    let termination = match verdict {
        Verdict::Refined => Termination::Converged,
        Verdict::KeptInitial(termination) => termination,
    };
    let mut outcome = Outcome::kept(&Isometry3::translation(x, 0.0, 0.0), termination);
    outcome.verdict = verdict;
    outcome.iterations = iterations;
    outcome.evaluation = loss.map(|mean_loss| Evaluation {
        n_pairs: 10,
        mean_loss,
    });
    outcome
}

const LOST: Verdict = Verdict::KeptInitial(Termination::PairsLost);
const NO_PAIRS: Verdict = Verdict::KeptInitial(Termination::NoPairs);

#[test]
fn outcomes_of_consecutive_stages_combine() {
    use Verdict::Refined;
    // Both moved: the pose and the report are those of the second.
    let both = outcome(1.0, Refined, 3, Some(5.0)).then(outcome(2.0, Refined, 4, Some(1.0)));
    assert_eq!(both, outcome(2.0, Refined, 7, Some(1.0)));
    // The second kept the first's pose: still a new pose. Its last evaluation is the second's, if
    // there is one.
    let kept = outcome(1.0, Refined, 3, Some(5.0)).then(outcome(1.0, LOST, 2, Some(9.0)));
    let mut expected = outcome(1.0, Refined, 5, Some(9.0));
    expected.termination = Termination::PairsLost;
    assert_eq!(kept, expected);
    let kept = outcome(1.0, Refined, 3, Some(5.0)).then(outcome(1.0, NO_PAIRS, 1, None));
    let mut expected = outcome(1.0, Refined, 4, Some(5.0));
    expected.termination = Termination::NoPairs;
    assert_eq!(kept, expected);
    // Neither moved: the last reason.
    let neither = outcome(0.0, LOST, 2, Some(5.0)).then(outcome(0.0, NO_PAIRS, 1, None));
    assert_eq!(neither, outcome(0.0, NO_PAIRS, 3, Some(5.0)));
    // Only the second moved: the evaluation of the first pose does not describe the new one.
    let moved = outcome(0.0, LOST, 2, Some(5.0)).then(outcome(2.0, Refined, 1, None));
    assert_eq!(moved, outcome(2.0, Refined, 3, None));
    assert_eq!((moved.n_pairs(), neither.n_pairs()), (0, 10));
    // An empty stage ends nothing, so the observer's stop of the one before it is reported.
    let stopped = Verdict::KeptInitial(Termination::Stopped);
    let stopped = outcome(1.0, stopped, 3, Some(5.0));
    let empty = Outcome::kept(&stopped.camera_from_object, Termination::Kept);
    assert_eq!(stopped.then(empty), stopped);
    // A stage that moved the pose without iterations is not empty.
    let limited = outcome(
        0.0,
        Verdict::KeptInitial(Termination::IterationLimit),
        4,
        None,
    );
    let moved = Outcome::refined(
        Isometry3::translation(1.0, 0.0, 0.0),
        Termination::Converged,
    );
    assert_eq!(limited.then(moved), outcome(1.0, Refined, 4, None));
}

#[test]
fn a_kept_outcome_has_the_initial_pose() {
    let init = pose(0.1, 0.2, 0.3, 0.1, 0.2, 0.3);
    let kept = Outcome::kept(&init, Termination::Degenerate);
    assert_eq!(bits(&kept.camera_from_object), bits(&init));
    assert_eq!(kept.verdict, Verdict::KeptInitial(Termination::Degenerate));
    assert_eq!(
        (kept.iterations, kept.evaluation, kept.n_pairs()),
        (0, None, 0)
    );
    let mut never = Repeat {
        times: 0,
        stage: Scheduled::new(kept, 1.0),
    };
    for (outcome, termination) in [
        (run(&mut Cascade(()), &init), Termination::Kept),
        (
            run(&mut Cascade(Vec::<Box<dyn Stage>>::new()), &init),
            Termination::Kept,
        ),
        (run(&mut never, &init), Termination::Kept),
    ] {
        assert_eq!(bits(&outcome.camera_from_object), bits(&init));
        assert_eq!(outcome.verdict, Verdict::KeptInitial(termination));
        assert_eq!(outcome.iterations, 0);
    }
}

fn refining(by: f64) -> Scheduled {
    Scheduled::new(outcome(0.0, Verdict::Refined, 2, Some(1.0)), by)
}

fn keeping() -> Scheduled {
    Scheduled::new(outcome(0.0, LOST, 1, Some(3.0)), 0.0)
}

#[test]
fn a_cascade_passes_every_pose_on() {
    let stages = [refining(1.0), keeping(), refining(10.0), refining(100.0)];
    let starts = stages.each_ref().map(|s| s.starts.clone());
    let [a, b, c, d] = stages;
    let outcome = run(&mut Cascade((a, b, c, d)), &Isometry3::identity());
    let starts = starts.map(|s| s.lock().unwrap().clone());
    assert_eq!(starts, [vec![0.0], vec![1.0], vec![1.0], vec![11.0]]);
    assert_eq!(
        (returned(&outcome), outcome.iterations, outcome.verdict),
        (111.0, 7, Verdict::Refined)
    );
}

#[test]
fn a_cascade_rolls_back_stage_by_stage() {
    let good: [Line; 3] = [(100, Some(3.0)), (100, Some(2.0)), (100, Some(1.0))];
    let bad: [Line; 2] = [(100, Some(3.0)), (10, Some(1.0))];
    let stop = || (Divergence::strict(), IterationLimit(3));
    // The second diverges at once: the pose is the first's, evaluated by the second.
    let later: Vec<Line> = [(0, None), (0, None)].into_iter().chain(bad).collect();
    let outcome = run(
        &mut Cascade((scripted(&good, stop()), scripted(&later, stop()))),
        &Isometry3::identity(),
    );
    assert_eq!((returned(&outcome), outcome.iterations), (2.0, 5));
    assert_eq!(
        (outcome.termination, outcome.verdict),
        (Termination::PairsLost, Verdict::Refined)
    );
    assert_eq!(
        outcome.evaluation,
        Some(Evaluation {
            n_pairs: 100,
            mean_loss: 3.0
        })
    );
    // The first diverges at once: the second starts from the initial pose.
    let outcome = run(
        &mut Cascade((scripted(&bad, stop()), scripted(&good, stop()))),
        &Isometry3::identity(),
    );
    assert_eq!(
        (returned(&outcome), outcome.verdict),
        (2.0, Verdict::Refined)
    );
    // Both diverge: the initial pose, bit for bit, and the last reason.
    let init = pose(0.0, -0.0, 0.4, 0.3, 0.2, 0.1);
    let outcome = run(
        &mut Cascade((scripted(&bad, stop()), scripted(&bad, stop()))),
        &init,
    );
    assert_eq!(bits(&outcome.camera_from_object), bits(&init));
    assert_eq!(outcome.verdict, LOST);
}

#[test]
fn tuples_vectors_and_boxes_of_stages_give_equal_bits() {
    let lines: Vec<Line> = (0..10_u8).map(|i| (100, Some(f64::from(20 - i)))).collect();
    let stage = || scripted(&lines, IterationLimit(3));
    let init = pose(0.0, 0.1, 0.4, 0.3, 0.2, 0.1);
    let tuple = run(&mut Cascade((stage(), stage(), stage())), &init);
    let boxed: Vec<Box<dyn Stage>> = vec![Box::new(stage()), Box::new(stage()), Box::new(stage())];
    for other in [
        run(&mut Cascade(vec![stage(), stage(), stage()]), &init),
        run(&mut Cascade(boxed), &init),
        run(
            &mut Repeat {
                times: 3,
                stage: stage(),
            },
            &init,
        ),
    ] {
        assert_eq!(
            bits(&other.camera_from_object),
            bits(&tuple.camera_from_object)
        );
        assert_eq!(other, tuple);
    }
    assert_eq!((tuple.iterations, returned(&tuple).round()), (9, 6.0));
    assert_eq!(
        run(&mut Cascade((stage(),)), &init),
        run(&mut stage(), &init)
    );
}

#[test]
fn a_repetition_ends_when_a_pass_keeps_its_pose() {
    let mut five = Repeat {
        times: 5,
        stage: refining(1.0),
    };
    let outcome = run(&mut five, &Isometry3::identity());
    assert_eq!(
        (
            returned(&outcome),
            outcome.iterations,
            five.stage.calls.get()
        ),
        (5.0, 10, 5)
    );
    let mut idle = Repeat {
        times: 5,
        stage: keeping(),
    };
    let outcome = run(&mut idle, &Isometry3::identity());
    assert_eq!(
        (idle.stage.calls.get(), outcome.verdict, outcome.iterations),
        (1, LOST, 1)
    );
    // Two passes of three evaluations, then the script has no more pairs.
    let lines: Vec<Line> = (0..5_u8).map(|i| (100, Some(f64::from(20 - i)))).collect();
    let mut stage = Repeat {
        times: 9,
        stage: scripted(&lines, IterationLimit(3)),
    };
    let outcome = run(&mut stage, &Isometry3::identity());
    // 0-1-2, 2-3-4, then 4 and nothing beyond.
    assert_eq!((returned(&outcome), outcome.iterations), (4.0, 8));
    assert_eq!(
        (outcome.termination, outcome.verdict),
        (Termination::NoPairs, Verdict::Refined)
    );
}

#[test]
fn a_pose_that_is_not_finite_passes_unchanged_through_compositions() {
    let lines: [Line; 2] = [(100, Some(2.0)), (100, Some(1.0))];
    let stage = || scripted(&lines, IterationLimit(2));
    let init = Isometry3::translation(f64::NAN, 0.0, 0.0);
    let mut repeat = Repeat {
        times: 7,
        stage: stage(),
    };
    for outcome in [
        run(&mut repeat, &init),
        run(&mut Cascade((stage(),)), &init),
    ] {
        assert_eq!(bits(&outcome.camera_from_object), bits(&init));
        assert_eq!(
            (outcome.verdict, outcome.iterations),
            (NO_PAIRS, 1),
            "and nothing is repeated"
        );
    }
    let outcome = run(&mut Cascade((stage(), stage())), &init);
    assert_eq!((outcome.verdict, outcome.iterations), (NO_PAIRS, 2));
}

#[test]
fn every_termination_has_a_different_explanation() {
    let ends = Termination::ALL;
    for (index, end) in ends.iter().enumerate() {
        assert!(
            end.explain().contains(' '),
            "{end}: expected a clause, found a name"
        );
        assert!(
            ends[..index]
                .iter()
                .all(|other| other.explain() != end.explain())
        );
    }
}

#[test]
fn a_custom_stage_reports_to_the_observer() {
    struct Reports;

    impl Stage for Reports {
        fn run(&mut self, _: &Problem<'_>, pose: &Isometry3<f64>, s: &mut Session<'_>) -> Outcome {
            let outcome = outcome(0.0, LOST, 1, Some(2.0));
            let evaluation = outcome.evaluation.unwrap();
            let event = IterationEvent::new(7, pose, evaluation, pose);
            assert!(s.observer.on_iteration(&event).is_continue());
            let mut event = StageEvent::new(&outcome);
            event.metric = "mine";
            s.observer.on_stage_end(&event);
            outcome
        }
    }

    let mut log = Log::default();
    let outcome = run_observed(&mut Reports, &Isometry3::identity(), &mut log);
    assert_eq!(log.iterations, [(7, 0.0, outcome.evaluation.unwrap())]);
    assert_eq!(log.stages, [(["none", "none", "mine"], 0, outcome)]);
}

#[test]
fn all_observers_receive_all_events_and_one_ends_the_run() {
    struct Breaks;

    impl Observer for Breaks {
        fn on_iteration(&mut self, _: &IterationEvent<'_>) -> ControlFlow<()> {
            ControlFlow::Break(())
        }
    }

    let lines = [(100, Some(3.0)), (100, Some(2.0))];
    let mut stage = scripted(&lines, IterationLimit(2));
    let (mut first, mut last) = (Log::default(), Box::new(Log::default()));
    let mut all = (&mut first, Breaks, &mut last);
    let outcome = run_observed(&mut stage, &Isometry3::identity(), &mut all);
    assert_eq!(outcome.termination, Termination::Stopped);
    assert_eq!((first.iterations.len(), first.stages.len()), (1, 1));
    assert_eq!(first.iterations, last.iterations);
    assert_eq!(first.stages, last.stages);
    let event = RegimeEvent {
        regime: Regime::ALIGNED,
        score: None,
    };
    (&mut first, ()).on_regime(&event);
    assert_eq!(first.regimes, [event]);
}
