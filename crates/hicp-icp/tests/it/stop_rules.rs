//! Tests of the divergence rules of §IV-B at their limits, and of combined rules (pitfall 10).

use std::sync::{Arc, Mutex};

use crate::script::{Line, returned, run, scripted};
use hicp_core::Isometry3;
use hicp_core::Iteration;
use hicp_icp::Judgment;
use hicp_icp::{
    Divergence, Evaluation, IterationLimit, LossRule, MAX_ITERATIONS, Outcome, Progress, StopRule,
    Termination, Verdict,
};

fn run_with(lines: &[Line], rule: Divergence) -> Outcome {
    run(
        &mut scripted(lines, (rule, IterationLimit(lines.len()))),
        &Isometry3::identity(),
    )
}

fn pairs(counts: &[usize]) -> Outcome {
    // The loss falls throughout, so that only the counts can end the stage.
    let lines: Vec<Line> = counts
        .iter()
        .zip(0_u8..)
        .map(|(n, i)| (*n, Some(f64::from(100 - i))))
        .collect();
    run_with(&lines, Divergence::strict())
}

fn losses(losses: &[f64]) -> Outcome {
    let lines: Vec<Line> = losses.iter().map(|loss| (100, Some(*loss))).collect();
    run_with(&lines, Divergence::strict())
}

#[test]
fn pitfall_10_at_most_five_percent_of_the_first_count_may_be_lost() {
    for k in [1, 5, 7, 50, 1000, 123_457] {
        // 19 of 20 are exactly 95 %.
        assert_eq!(
            pairs(&[20 * k, 19 * k]).termination,
            Termination::IterationLimit
        );
        let outcome = pairs(&[20 * k, 19 * k - 1]);
        assert_eq!(outcome.termination, Termination::PairsLost);
        assert_eq!(
            outcome.verdict,
            Verdict::KeptInitial(Termination::PairsLost)
        );
        assert_eq!(
            outcome.evaluation,
            Some(Evaluation {
                n_pairs: 20 * k,
                mean_loss: 100.0
            })
        );
    }
}

#[test]
fn pitfall_10_small_losses_add_up_against_the_first_count() {
    // Each step loses 3 %. At the second, the loss since the first exceeds 5 %.
    let outcome = pairs(&[1000, 970, 941, 913]);
    assert_eq!(
        (outcome.termination, returned(&outcome), outcome.iterations),
        (Termination::PairsLost, 1.0, 3)
    );
}

#[test]
fn pitfall_10_the_previous_count_matters_when_the_first_was_small() {
    let outcome = pairs(&[100, 1000, 949]);
    assert_eq!(
        (outcome.termination, returned(&outcome)),
        (Termination::PairsLost, 1.0)
    );
    assert_eq!(
        pairs(&[100, 1000, 950]).termination,
        Termination::IterationLimit
    );
    // Growing and shrinking within both limits is accepted.
    assert_eq!(
        pairs(&[100, 104, 99, 103, 98]).termination,
        Termination::IterationLimit
    );
}

#[test]
fn pitfall_10_a_falling_loss_with_too_few_pairs_is_rejected() {
    let outcome = run_with(&[(100, Some(4.0)), (50, Some(1.0))], Divergence::strict());
    assert_eq!(outcome.termination, Termination::PairsLost);
}

#[test]
fn a_rising_mean_loss_rolls_back_to_the_previous_pose() {
    let outcome = losses(&[4.0, 3.0, 2.0, 2.5, 1.0]);
    assert_eq!(
        (outcome.termination, returned(&outcome), outcome.iterations),
        (Termination::LossIncreased, 2.0, 4)
    );
    assert_eq!(
        outcome.evaluation,
        Some(Evaluation {
            n_pairs: 100,
            mean_loss: 2.0
        })
    );
    assert_eq!(outcome.verdict, Verdict::Refined);
    // Compared with the previous loss and not with the first: 3.5 is below 4 and still a rise.
    assert_eq!(returned(&losses(&[4.0, 3.0, 3.5])), 1.0);
    let outcome = losses(&[3.0, 4.0]);
    assert_eq!(
        outcome.verdict,
        Verdict::KeptInitial(Termination::LossIncreased)
    );
}

#[test]
fn a_rise_within_the_tolerance_is_left_to_convergence() {
    assert_eq!(Divergence::strict().rise_tolerance, 1e-3);
    assert_eq!(
        losses(&[1.0, 1.000_999]).termination,
        Termination::IterationLimit
    );
    assert_eq!(
        losses(&[1.0, 1.001_001]).termination,
        Termination::LossIncreased
    );
    let exact = Divergence {
        rise_tolerance: 0.0,
        ..Divergence::strict()
    };
    let at = |loss: f64| run_with(&[(100, Some(1.0)), (100, Some(loss))], exact).termination;
    assert_eq!(at(1.0), Termination::IterationLimit);
    assert_eq!(at(1.0_f64.next_up()), Termination::LossIncreased);
    // After a perfect fit, every loss is a rise.
    assert_eq!(
        losses(&[1.0, 0.0, 1e-300]).termination,
        Termination::LossIncreased
    );
}

#[test]
fn the_count_aware_rule_accepts_a_rise_with_new_pairs() {
    let rise = |n: usize, rule| run_with(&[(100, Some(1.0)), (n, Some(2.0))], rule).termination;
    assert_eq!(rise(101, Divergence::strict()), Termination::LossIncreased);
    assert_eq!(
        rise(101, Divergence::count_aware()),
        Termination::IterationLimit
    );
    assert_eq!(
        rise(100, Divergence::count_aware()),
        Termination::LossIncreased
    );
    assert_eq!(
        rise(99, Divergence::count_aware()),
        Termination::LossIncreased
    );
    assert_eq!(rise(90, Divergence::count_aware()), Termination::PairsLost);
    assert_eq!(Divergence::default(), Divergence::strict());
    assert_eq!(Divergence::count_aware().loss_rule, LossRule::CountAware);
    // If both rules are violated, the reason is lost pairs.
    assert_eq!(rise(90, Divergence::strict()), Termination::PairsLost);
}

/// Records the iterations that it receives and ends at a given one.
#[derive(Clone)]
struct Noting {
    break_at: Option<usize>,
    with: Judgment,
    seen: Arc<Mutex<Vec<usize>>>,
    starts: Arc<Mutex<usize>>,
}

impl Noting {
    fn new(break_at: Option<usize>, with: Judgment) -> Self {
        Self {
            break_at,
            with,
            seen: Arc::default(),
            starts: Arc::default(),
        }
    }
}

impl StopRule for Noting {
    fn start(&mut self) {
        *self.starts.lock().unwrap() += 1;
    }

    fn check(&mut self, iteration: &Iteration<'_>, _progress: &Progress<'_>) -> Judgment {
        self.seen.lock().unwrap().push(iteration.index);
        if self.break_at == Some(iteration.index) {
            self.with
        } else {
            Judgment::Continue
        }
    }
}

#[test]
fn every_rule_of_a_tuple_is_called_and_the_first_to_end_decides() {
    let lines: Vec<Line> = (0..6_u8).map(|i| (100, Some(f64::from(10 - i)))).collect();
    for (a, b, expected, at) in [
        (Some(2), Some(2), Termination::Converged, 2),
        (Some(3), Some(1), Termination::PairsLost, 1),
        (None, Some(4), Termination::PairsLost, 4),
        (Some(0), None, Termination::Converged, 0),
    ] {
        let first = Noting::new(a, Judgment::Accept(Termination::Converged));
        let second = Noting::new(b, Judgment::Reject(Termination::PairsLost));
        let third = Noting::new(None, Judgment::Accept(Termination::IterationLimit));
        let stop = (first.clone(), second.clone(), third.clone());
        let outcome = run(&mut scripted(&lines, stop), &Isometry3::identity());
        assert_eq!(outcome.termination, expected);
        for rule in [&first, &second, &third] {
            assert_eq!(*rule.seen.lock().unwrap(), (0..=at).collect::<Vec<_>>());
            assert_eq!(*rule.starts.lock().unwrap(), 1);
        }
        // A rollback returns the pose before; any other reason returns the judged pose.
        let rolled_back = expected == Termination::PairsLost;
        assert_eq!(
            returned(&outcome),
            if rolled_back {
                at as f64 - 1.0
            } else {
                at as f64
            }
        );
    }
}

#[test]
fn without_rules_a_stage_ends_at_the_limit_of_the_engine() {
    let lines = vec![(100, Some(1.0)); MAX_ITERATIONS + 1];
    let outcome = run(&mut scripted(&lines, ()), &Isometry3::identity());
    assert_eq!(outcome.termination, Termination::IterationLimit);
    assert_eq!(outcome.iterations, MAX_ITERATIONS);
}

#[test]
fn rules_restart_with_every_run_also_if_boxed() {
    let lines: Vec<Line> = (0..3_u8).map(|i| (100, Some(f64::from(10 - i)))).collect();
    let rule = Noting::new(Some(1), Judgment::Accept(Termination::Converged));
    let boxed: Box<dyn StopRule> = Box::new((rule.clone(),));
    let mut stage = scripted(&lines, boxed);
    for runs in 1..4 {
        assert_eq!(run(&mut stage, &Isometry3::identity()).iterations, 2);
        assert_eq!(*rule.starts.lock().unwrap(), runs);
        assert_eq!(rule.seen.lock().unwrap().len(), 2 * runs);
    }
}

#[test]
fn terminations_have_names() {
    use Termination::{Converged, Degenerate, IterationLimit, LossIncreased, NoPairs, PairsLost};
    let all = [
        (Converged, "converged"),
        (IterationLimit, "iteration_limit"),
        (NoPairs, "no_pairs"),
        (PairsLost, "pairs_lost"),
        (LossIncreased, "loss_increased"),
        (Degenerate, "degenerate"),
    ];
    for (termination, name) in all {
        assert_eq!(
            (termination.name(), termination.to_string()),
            (name, name.to_string())
        );
    }
}

/// A rule may define a custom reason. Its judgment, and not the reason, decides whether the pose is
/// accepted.
#[test]
fn custom_reasons_accept_or_reject_as_the_rule_judges() {
    let lines: Vec<Line> = (0..6_u8).map(|i| (100, Some(f64::from(10 - i)))).collect();
    let reason = Termination::Custom("battery_low");
    for (judgment, x) in [
        (Judgment::Accept(reason), 2.0),
        (Judgment::Reject(reason), 1.0),
    ] {
        let stop = Noting::new(Some(2), judgment);
        let outcome = run(&mut scripted(&lines, stop), &Isometry3::identity());
        assert_eq!((outcome.termination, returned(&outcome)), (reason, x));
        assert_eq!(outcome.termination.to_string(), "battery_low");
    }
}
