//! The laws of stop rules.

use hybrid_icp::core::{Isometry3, Iteration, Problem, Vector3, se3};
use hybrid_icp::icp::{Evaluation, Judgment, Progress, StopRule};

use crate::law::{BOXED, PURE, Subject};

/// What [`check_stop_rule`] may take for granted of a rule beyond the trait's contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StopRuleLaws {
    /// Equal runs give equal verdicts. False only for rules that read the clock.
    pub deterministic: bool,
}

impl Default for StopRuleLaws {
    fn default() -> Self {
        Self {
            deterministic: true,
        }
    }
}

/// One run as a rule sees it: a name, and (pairs, loss, pose) per iteration.
struct Course {
    name: &'static str,
    turns: Vec<(usize, f64, Isometry3<f64>)>,
}

/// Checks a [`StopRule`]; `make` makes a fresh one.
///
/// # Laws
///
/// - `start` forgets: after it, a used rule judges a run as a fresh one does, also when the run before was broken off.
/// - Boxed rules, and the rule alone in a tuple or a `Vec`, give the same verdicts.
/// - Never panics: also on losses and poses that are not finite, and without pairs.
///
/// # Panics
///
/// Panics with the law, the input and what was found when a law is broken.
pub fn check_stop_rule<T: StopRule + 'static>(make: impl Fn() -> T, laws: StopRuleLaws) {
    let subject = Subject::new::<T>(None);
    let courses = courses();
    for course in &courses {
        let input = course.name;
        let judge =
            |rule: &mut dyn StopRule| subject.calm(input, || verdicts(rule, course, usize::MAX));
        let expected = judge(&mut make());
        if !laws.deterministic {
            judge(&mut make());
            continue;
        }
        subject.same(PURE, input, &expected, &judge(&mut make()));
        for before in &courses {
            for broken_off_after in [1, 2, 3, 5, 8, usize::MAX] {
                let mut used = make();
                let input = format!("{input}, after a run of: {}", before.name);
                subject.calm(&input, || verdicts(&mut used, before, broken_off_after));
                subject.same(
                    "start forgets: a used rule judges as a fresh one",
                    &input,
                    &expected,
                    &judge(&mut used),
                );
            }
        }
        let mut boxed: Box<dyn StopRule> = Box::new(make());
        verdicts(&mut boxed, &courses[0], 2);
        subject.same(BOXED, input, &expected, &judge(&mut boxed));
        subject.same(
            "a tuple of one rule is that rule",
            input,
            &expected,
            &judge(&mut (make(),)),
        );
        subject.same(
            "a list of one rule is that rule",
            input,
            &expected,
            &judge(&mut vec![make()]),
        );
    }
}

/// Starts the rule and lets it judge until it ends the stage; at most `limit` iterations.
fn verdicts<S: StopRule + ?Sized>(rule: &mut S, course: &Course, limit: usize) -> Vec<Judgment> {
    rule.start();
    let mut verdicts = Vec::new();
    let evaluation = |turn: &(usize, f64, Isometry3<f64>)| Evaluation {
        n_pairs: turn.0,
        mean_loss: turn.1,
    };
    for (iteration, turn) in course.turns.iter().enumerate().take(limit) {
        let next = course.turns.get(iteration + 1).unwrap_or(turn).2;
        let at = Iteration::new(iteration, &course.turns[0].2, Problem::default());
        let verdict = rule.check(
            &at,
            &Progress {
                current: evaluation(turn),
                first: evaluation(&course.turns[0]),
                previous: iteration
                    .checked_sub(1)
                    .map(|i| evaluation(&course.turns[i])),
                camera_from_object: &turn.2,
                increment: &(next * turn.2.inverse()),
            },
        );
        verdicts.push(verdict);
        if verdict != Judgment::Continue {
            break;
        }
    }
    verdicts
}

fn courses() -> Vec<Course> {
    let start = Isometry3::translation(0.1, -0.05, 0.6);
    // The distance of every turn to the goal along a twist.
    let at = |share: f64| {
        let twist = hybrid_icp::core::Vector6::new(0.02, 0.01, -0.03, 0.2, -0.1, 0.3) * share;
        se3::exp(&twist) * start
    };
    let course = |name, turn: &dyn Fn(i32) -> (usize, f64, f64)| Course {
        name,
        turns: (0..60)
            .map(|i| {
                let (pairs, loss, share) = turn(i);
                (pairs, loss, at(share))
            })
            .collect(),
    };
    let mut lost = course("a pose that turns into NaN", &|i| {
        (300, 1e-4 * 0.5_f64.powi(i), 0.5_f64.powi(i))
    });
    for turn in &mut lost.turns[3..] {
        turn.2.translation.vector = Vector3::repeat(f64::NAN);
    }
    vec![
        course("a loss that falls", &|i| {
            (300, 1e-4 * 0.7_f64.powi(i) + 1e-7, 0.7_f64.powi(i))
        }),
        course("a loss that falls to zero at once", &|i| {
            (
                300,
                if i == 0 { 1e-4 } else { 0.0 },
                if i == 0 { 1.0 } else { 0.0 },
            )
        }),
        course("a loss that stands still", &|_| (300, 1e-5, 0.5)),
        course("a loss that rises", &|i| {
            (300, 1e-5 * 1.2_f64.powi(i), f64::from(i))
        }),
        course("pairs that get lost", &|i| {
            (
                300 - usize::try_from(i).unwrap_or(0) * 5,
                1e-5 * 0.9_f64.powi(i),
                0.8_f64.powi(i),
            )
        }),
        course("a pose that goes to and fro", &|i| {
            (300, 1e-5 * 0.99_f64.powi(i), f64::from(i % 2))
        }),
        course("losses of NaN", &|i| (300, f64::NAN, 0.8_f64.powi(i))),
        course("infinite losses", &|i| {
            (
                300,
                if i % 2 == 0 { f64::INFINITY } else { 1e-5 },
                0.8_f64.powi(i),
            )
        }),
        course("no pairs", &|_| (0, 0.0, 0.0)),
        lost,
    ]
}
