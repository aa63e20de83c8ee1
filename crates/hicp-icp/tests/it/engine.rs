//! Tests of the engine of Algorithm 1 with scripted components: its poses and its reports.

use std::ops::ControlFlow;

use crate::script::support::{bits, pose};
use crate::script::{Line, Log, returned, run, run_observed, scripted};
use hicp_core::Iteration;
use hicp_core::{Correspondences, Isometry3, Pair};
use hicp_icp::Judgment;
use hicp_icp::{
    Convergence, Divergence, Evaluation, Icp, IterationEvent, IterationLimit, Observer, Progress,
    Stage, StopRule, Termination, Verdict,
};
use hicp_metric::{ErrorMetric, NormalEquations, Step};

fn limit(lines: &[Line], n: usize) -> impl Stage {
    scripted(lines, IterationLimit(n))
}

const FALLING: [Line; 5] = [
    (100, Some(5.0)),
    (100, Some(4.0)),
    (100, Some(3.0)),
    (100, Some(2.0)),
    (100, Some(1.0)),
];

/// A pose that every arithmetic operation changes: not normalized, and with a negative zero.
fn odd_pose() -> Isometry3<f64> {
    let mut odd = pose(0.0, -0.0, 0.3, 0.1, 0.2, 0.3);
    odd.rotation.as_mut_unchecked().coords *= 1.0 + 1e-9;
    odd
}

#[test]
fn pitfall_1_no_pairs_keep_the_initial_pose_bit_for_bit() {
    let mut stage = limit(&[(0, Some(0.0))], 10);
    let outcome = run(&mut stage, &odd_pose());
    assert_eq!(bits(&outcome.camera_from_object), bits(&odd_pose()));
    assert_eq!(outcome.termination, Termination::NoPairs);
    assert_eq!(outcome.verdict, Verdict::KeptInitial(Termination::NoPairs));
    assert_eq!(
        (outcome.evaluation, outcome.n_pairs(), outcome.iterations),
        (None, 0, 1)
    );
}

#[test]
fn pitfall_5_a_metric_without_a_step_is_an_outcome() {
    let outcome = run(&mut limit(&[(100, None)], 10), &odd_pose());
    assert_eq!(bits(&outcome.camera_from_object), bits(&odd_pose()));
    assert_eq!(
        outcome.verdict,
        Verdict::KeptInitial(Termination::Degenerate)
    );
    assert_eq!((outcome.evaluation, outcome.iterations), (None, 1));
}

#[test]
fn losing_all_pairs_later_returns_the_last_evaluated_pose() {
    for (last, termination) in [
        ((0, Some(1.0)), Termination::NoPairs),
        ((90, None), Termination::Degenerate),
    ] {
        let lines = [(100, Some(3.0)), (100, Some(2.0)), last];
        let outcome = run(&mut limit(&lines, 10), &Isometry3::identity());
        assert_eq!(returned(&outcome), 1.0);
        assert_eq!(
            (outcome.termination, outcome.verdict),
            (termination, Verdict::Refined)
        );
        assert_eq!(
            outcome.evaluation,
            Some(Evaluation {
                n_pairs: 100,
                mean_loss: 2.0
            })
        );
        assert_eq!(outcome.iterations, 3);
        // Directly after the first evaluation, that pose is the initial one.
        let outcome = run(&mut limit(&[(100, Some(3.0)), last], 10), &odd_pose());
        assert_eq!(bits(&outcome.camera_from_object), bits(&odd_pose()));
        assert_eq!(outcome.verdict, Verdict::KeptInitial(termination));
        assert_eq!(
            outcome.evaluation,
            Some(Evaluation {
                n_pairs: 100,
                mean_loss: 3.0
            })
        );
    }
}

#[test]
fn the_iteration_limit_counts_evaluations() {
    for (n, evaluations) in [(0, 1), (1, 1), (2, 2), (5, 5)] {
        let outcome = run(&mut limit(&FALLING, n), &Isometry3::identity());
        assert_eq!(outcome.iterations, evaluations, "limit {n}");
        assert_eq!(outcome.termination, Termination::IterationLimit);
        // The last evaluated pose is returned with its own numbers, and not the step that was not
        // evaluated.
        assert_eq!(returned(&outcome), (evaluations - 1) as f64);
        assert_eq!(
            outcome.evaluation.unwrap().mean_loss,
            FALLING[evaluations - 1].1.unwrap()
        );
        let kept = outcome.verdict == Verdict::KeptInitial(Termination::IterationLimit);
        assert_eq!(
            kept,
            evaluations == 1,
            "one evaluation is that of the initial pose"
        );
    }
    assert_eq!(IterationLimit::default(), IterationLimit(50));
}

#[test]
fn convergence_accepts_the_candidate() {
    let stop = || {
        (
            Convergence {
                relative_change: 0.01,
                negligible_loss: 0.0,
            },
            IterationLimit(50),
        )
    };
    // A change of less than 1 %, down or up, has settled. A change of exactly 1 % has not.
    for (before, last) in [(2.0, 1.981), (2.0, 2.019)] {
        let lines = [
            (100, Some(3.0)),
            (100, Some(before)),
            (100, Some(last)),
            (100, Some(0.5)),
        ];
        let outcome = run(&mut scripted(&lines, stop()), &Isometry3::identity());
        assert_eq!(outcome.termination, Termination::Converged);
        assert_eq!((returned(&outcome), outcome.iterations), (2.0, 3));
        assert_eq!(outcome.evaluation.unwrap().mean_loss, last);
    }
    let lines = [
        (100, Some(4.0)),
        (100, Some(2.0)),
        (100, Some(1.0)),
        (100, Some(1.0)),
    ];
    let quarter = Convergence {
        relative_change: 0.5,
        negligible_loss: 0.0,
    };
    let outcome = run(&mut scripted(&lines, quarter), &Isometry3::identity());
    assert_eq!(
        returned(&outcome),
        3.0,
        "a change equal to the limit counts"
    );
}

#[test]
fn a_loss_of_zero_has_converged() {
    let outcome = run(
        &mut scripted(&[(10, Some(0.0)), (10, Some(0.0))], Convergence::default()),
        &Isometry3::identity(),
    );
    assert_eq!(
        (outcome.termination, returned(&outcome)),
        (Termination::Converged, 1.0)
    );
    // Noise at the resolution of f32 does not count; the step down to it does.
    let lines = [
        (10, Some(1e-3)),
        (10, Some(1e-15)),
        (10, Some(9e-15)),
        (10, Some(1e-20)),
    ];
    let outcome = run(
        &mut scripted(&lines, Convergence::default()),
        &Isometry3::identity(),
    );
    assert_eq!(
        (outcome.termination, returned(&outcome)),
        (Termination::Converged, 2.0)
    );
}

#[test]
fn pitfall_8_a_second_run_repeats_the_first() {
    let mut stage = scripted(
        &FALLING,
        (
            Divergence::strict(),
            Convergence::default(),
            IterationLimit(4),
        ),
    );
    let init = pose(0.0, 0.1, 0.4, 0.1, 0.0, 0.2);
    let first = run(&mut stage, &init);
    for _ in 0..3 {
        let again = run(&mut stage, &init);
        assert_eq!(
            bits(&again.camera_from_object),
            bits(&first.camera_from_object)
        );
        assert_eq!(again, first);
    }
    assert_eq!(first.iterations, 4);
}

#[test]
fn an_initial_pose_that_is_not_finite_is_returned_unchanged() {
    let broken = |i: usize, value: f64| {
        let mut broken = odd_pose();
        if i < 3 {
            broken.translation.vector[i] = value;
        } else {
            broken.rotation.as_mut_unchecked().coords[i - 3] = value;
        }
        broken
    };
    for value in [f64::NAN, f64::INFINITY] {
        for i in 0..7 {
            let init = broken(i, value);
            let outcome = run(&mut limit(&FALLING, 5), &init);
            assert_eq!(bits(&outcome.camera_from_object), bits(&init));
            assert_eq!(outcome.verdict, Verdict::KeptInitial(Termination::NoPairs));
            assert_eq!(outcome.evaluation, None);
        }
    }
}

#[test]
fn unbounded_steps_end_at_the_last_finite_pose() {
    // At the largest f64, a meter changes nothing, and the script has ended: no pairs.
    let outcome = run(
        &mut limit(&FALLING, 5),
        &Isometry3::translation(f64::MAX, 0.0, 0.0),
    );
    assert_eq!(outcome.termination, Termination::NoPairs);
    assert_eq!(returned(&outcome), f64::MAX);
}

/// Steps by a meter. From a given evaluation on, the step is not a number.
#[derive(Clone)]
struct Breaking {
    script: crate::script::Scripted,
    from: f32,
    with: f64,
}

impl ErrorMetric for Breaking {
    fn linearize(&self, _: &Pair, _: &mut NormalEquations) {}

    fn step(&self, pairs: &Correspondences) -> Option<Step> {
        let step = self.script.step(pairs)?;
        let broken = pairs.as_slice()[0].source.point.x >= self.from;
        let by = if broken { self.with } else { 1.0 };
        Some(Step {
            increment: Isometry3::translation(by, 0.0, 0.0),
            ..step
        })
    }
}

/// A step that is skipped while success is reported would hide that nothing was done.
#[test]
fn a_step_that_is_not_a_number_ends_the_run_at_the_last_evaluated_pose() {
    for with in [f64::NAN, f64::INFINITY] {
        for from in [0.0, 1.0, 3.0] {
            let script = crate::script::Scripted::new(&FALLING);
            let mut stage = Icp {
                selection: script.clone(),
                association: script.clone(),
                filter: (),
                metric: Breaking { script, from, with },
                stop: IterationLimit(10),
            };
            let outcome = run(&mut stage, &Isometry3::identity());
            assert_eq!(outcome.termination, Termination::Degenerate);
            assert_eq!(returned(&outcome), f64::from(from));
            let kept = Verdict::KeptInitial(Termination::Degenerate);
            assert_eq!(outcome.verdict == kept, from == 0.0);
        }
    }
}

#[test]
fn the_observer_receives_every_evaluation_and_the_end() {
    let lines = [(100, Some(3.0)), (100, Some(2.0)), (100, Some(7.0))];
    let mut log = Log::default();
    let mut stage = scripted(&lines, Divergence::strict());
    let outcome = run_observed(&mut stage, &Isometry3::identity(), &mut log);
    let expected: Vec<_> = [3.0, 2.0, 7.0]
        .into_iter()
        .enumerate()
        .map(|(i, mean_loss)| {
            (
                i,
                i as f64,
                Evaluation {
                    n_pairs: 100,
                    mean_loss,
                },
            )
        })
        .collect();
    assert_eq!(
        log.iterations, expected,
        "the rejected candidate is among them"
    );
    let names = [
        "scripted-selection",
        "scripted-association",
        "scripted-metric",
    ];
    assert_eq!(log.stages, [(names, 1, outcome)]);
    assert_eq!(
        (outcome.termination, returned(&outcome)),
        (Termination::LossIncreased, 1.0)
    );
}

/// Stores the number of pairs of each event.
#[derive(Default)]
struct PairCounts(Vec<Option<usize>>);

impl Observer for PairCounts {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        self.0.push(event.pairs.map(Correspondences::len));
        ControlFlow::Continue(())
    }
}

#[test]
fn the_observer_receives_the_pairs() {
    let mut counts = PairCounts::default();
    let lines = [(100, Some(3.0)), (90, Some(2.0))];
    let mut stage = scripted(&lines, IterationLimit(2));
    run_observed(&mut stage, &Isometry3::identity(), &mut counts);
    assert_eq!(counts.0, [Some(100), Some(90)]);
}

/// A rule that checks its arguments.
struct Checking;

impl StopRule for Checking {
    fn check(&mut self, iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        let at = |i: usize| Evaluation {
            n_pairs: FALLING[i].0,
            mean_loss: FALLING[i].1.unwrap(),
        };
        let i = iteration.index;
        assert_eq!(progress.current, at(i));
        assert_eq!(progress.first, at(0));
        assert_eq!(progress.previous, i.checked_sub(1).map(at));
        assert_eq!(progress.camera_from_object.translation.vector.x, i as f64);
        assert_eq!(iteration.init.translation.vector.x, 0.0);
        assert_eq!(progress.increment.translation.vector.x, 1.0);
        assert_eq!(progress.pairs.len(), at(i).n_pairs);
        let pose = progress.pairs.camera_from_object();
        assert_eq!(pose, progress.camera_from_object);
        Judgment::Continue
    }
}

#[test]
fn rules_receive_the_first_the_previous_and_the_current_evaluation() {
    let outcome = run(
        &mut scripted(&FALLING, (Checking, IterationLimit(5))),
        &Isometry3::identity(),
    );
    assert_eq!(outcome.iterations, 5);
}
