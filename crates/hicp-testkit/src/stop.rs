//! The laws of stop rules.

use hybrid_icp::core::{
    Correspondences, Isometry3, Iteration, Pair, Point3, Problem, Surfel, Vector3, Vector6, se3,
};
use hybrid_icp::icp::{Evaluation, Judgment, Progress, StopRule};

use crate::law::{BOXED, PURE, Subject};

/// The laws that [`check_stop_rule`] checks beyond the contract of the trait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StopRuleLaws {
    /// Equal runs give equal verdicts. False only for rules that read the clock, which are only
    /// checked for panics.
    pub deterministic: bool,
}

impl Default for StopRuleLaws {
    fn default() -> Self {
        Self {
            deterministic: true,
        }
    }
}

/// A run as input of a rule: a name, and (pairs, loss, pose) of each iteration.
struct Course {
    name: &'static str,
    iterations: Vec<(usize, f64, Isometry3<f64>)>,
}

/// Checks a [`StopRule`]; `make` creates a fresh one.
///
/// # Laws
///
/// - `start` forgets: after it, a used rule gives the verdicts of a fresh one, also if the earlier
///   run was interrupted.
/// - A boxed rule, and the rule alone in a tuple or a `Vec`, give the same verdicts.
/// - Never panics: also for losses and poses that are not finite, and without pairs.
///
/// # Panics
///
/// Panics if a law is broken, with the law, the input and the value found.
pub fn check_stop_rule<T: StopRule + 'static>(make: impl Fn() -> T, laws: StopRuleLaws) {
    let subject = Subject::new::<T>(None);
    let courses = courses();
    for course in &courses {
        let trial = subject.on(course.name);
        let judge = |rule: &mut (dyn StopRule + 'static)| verdicts(rule, course, usize::MAX);
        if !laws.deterministic {
            trial.calm(|| judge(&mut make()));
            continue;
        }
        let expected = trial.calm(|| judge(&mut make()));
        trial.same(PURE, &expected, &trial.calm(|| judge(&mut make())));
        for before in &courses {
            for broken_off_after in [1, 2, 3, 5, 8, usize::MAX] {
                let mut used = make();
                let input = format!("{}, after a run of: {}", course.name, before.name);
                let trial = subject.on(&input);
                trial.calm(|| verdicts(&mut used, before, broken_off_after));
                let law = "start forgets: a used rule gives the verdicts of a fresh one";
                trial.same(law, &expected, &trial.calm(|| judge(&mut used)));
            }
        }
        let mut boxed: Box<dyn StopRule> = Box::new(make());
        verdicts(&mut boxed, &courses[0], 2);
        trial.same(BOXED, &expected, &trial.calm(|| judge(&mut boxed)));
        let law = "a tuple of one rule gives the verdicts of that rule";
        trial.same(law, &expected, &trial.calm(|| judge(&mut (make(),))));
        let law = "a list of one rule gives the verdicts of that rule";
        trial.same(law, &expected, &trial.calm(|| judge(&mut vec![make()])));
    }
}

/// Starts the rule and collects its verdicts until it ends the stage, for at most `limit`
/// iterations.
fn verdicts(rule: &mut dyn StopRule, course: &Course, limit: usize) -> Vec<Judgment> {
    rule.start();
    let mut verdicts = Vec::new();
    let evaluation =
        |&(n_pairs, mean_loss, _): &(usize, f64, Isometry3<f64>)| Evaluation { n_pairs, mean_loss };
    let first = &course.iterations[0];
    let mut previous = None;
    for (index, current) in course.iterations.iter().enumerate().take(limit) {
        let next = course.iterations.get(index + 1).unwrap_or(current).2;
        let surfel = Surfel {
            point: Point3::new(0.0, 0.0, 0.6),
            normal: -Vector3::z_axis(),
        };
        let mut pairs = Correspondences::new();
        pairs.begin(&current.2, first.0);
        pairs.extend(
            (0..)
                .map(|i| Pair::new(i, surfel, i, surfel))
                .take(current.0),
        );
        let progress = Progress {
            current: evaluation(current),
            first: evaluation(first),
            previous,
            camera_from_object: &current.2,
            increment: &(next * current.2.inverse()),
            pairs: &pairs,
        };
        let iteration = Iteration::new(index, &first.2, Problem::default());
        verdicts.push(rule.check(&iteration, &progress));
        if verdicts[index] != Judgment::Continue {
            break;
        }
        previous = Some(evaluation(current));
    }
    verdicts
}

fn courses() -> Vec<Course> {
    let start = Isometry3::translation(0.1, -0.05, 0.6);
    // The pose with a given share of the initial error left, along a twist.
    let at = |share: f64| {
        let twist = Vector6::new(0.02, 0.01, -0.03, 0.2, -0.1, 0.3) * share;
        se3::exp(&twist) * start
    };
    // Each iteration has a number of pairs, a loss and a share.
    let course = |name, iteration: &dyn Fn(i32) -> (usize, f64, f64)| Course {
        name,
        iterations: (0..60)
            .map(iteration)
            .map(|(pairs, loss, share)| (pairs, loss, at(share)))
            .collect(),
    };
    let mut lost = course("a pose that becomes NaN", &|i| {
        (300, 1e-4 * 0.5_f64.powi(i), 0.5_f64.powi(i))
    });
    for iteration in &mut lost.iterations[3..] {
        iteration.2.translation.vector = Vector3::repeat(f64::NAN);
    }
    let pairs = |i: i32| 300 - 5 * i.unsigned_abs() as usize;
    vec![
        course("a loss that falls", &|i| {
            (300, 1e-4 * 0.7_f64.powi(i) + 1e-7, 0.7_f64.powi(i))
        }),
        course("a loss that falls to zero at once", &|i| {
            if i == 0 {
                (300, 1e-4, 1.0)
            } else {
                (300, 0.0, 0.0)
            }
        }),
        course("a constant loss", &|_| (300, 1e-5, 0.5)),
        course("a loss that rises", &|i| {
            (300, 1e-5 * 1.2_f64.powi(i), f64::from(i))
        }),
        course("a falling number of pairs", &|i| {
            (pairs(i), 1e-5 * 0.9_f64.powi(i), 0.8_f64.powi(i))
        }),
        course("a pose that oscillates", &|i| {
            (300, 1e-5 * 0.99_f64.powi(i), f64::from(i % 2))
        }),
        course("losses of NaN", &|i| (300, f64::NAN, 0.8_f64.powi(i))),
        course("infinite losses", &|i| {
            let loss = [f64::INFINITY, 1e-5][(i % 2).unsigned_abs() as usize];
            (300, loss, 0.8_f64.powi(i))
        }),
        course("no pairs", &|_| (0, 0.0, 0.0)),
        lost,
    ]
}
