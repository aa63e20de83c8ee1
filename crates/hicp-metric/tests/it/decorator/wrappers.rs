//! Tests that decorators forward what they do not change.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use crate::scenes::{AtStart, Numbers, center, messy};
use hicp_core::Iteration;
use hicp_core::{Correspondences, Isometry3, Pair, Problem};
use hicp_metric::Minimize;
use hicp_metric::{
    Conditioned, Degeneracy, ErrorMetric, Frame, Frozen, GaussNewton, Generalized, Kernel,
    LevenbergMarquardt, MetricSchedule, NormalEquations, PlaneToPoint, PointToPlane, PointToPoint,
    PosePrior, Prior, Robust, Scale, Symmetric, WeightedSum,
};

type Seen = Rc<RefCell<Vec<(usize, Isometry3<f64>)>>>;

/// A decorator that records the iterations that it receives.
#[derive(Clone)]
struct Spy<M> {
    metric: M,
    seen: Seen,
}

impl<M> Spy<M> {
    fn record(&self, iteration: &Iteration<'_>) {
        let seen = (iteration.index, iteration.init);
        self.seen.borrow_mut().push(seen);
    }
}

impl<M: Minimize> Minimize for Spy<M> {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.metric)
    }

    fn system(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<NormalEquations> {
        self.record(iteration);
        self.metric.system(iteration, pairs)
    }

    fn mean_loss(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        self.record(iteration);
        self.metric.mean_loss(iteration, pairs)
    }

    fn add_squared_errors(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
        factor: f64,
        errors: &mut [f64],
    ) {
        self.record(iteration);
        self.metric
            .add_squared_errors(iteration, pairs, factor, errors);
    }

    fn label(&self) -> &'static str {
        "spy"
    }
}

/// Returns decorators around one metric that change neither a pair's error nor the mean of all,
/// with their names.
fn around<M: Minimize + Clone + 'static>(metric: &M) -> Vec<(&'static str, Box<dyn Minimize>)> {
    let metric = || metric.clone();
    let prior = Prior::AboutInitial {
        translation_meters: 0.1,
        rotation_degrees: 10.0,
    };
    vec![
        (
            "conditioned",
            Box::new(Conditioned {
                metric: metric(),
                policy: Degeneracy::Damp,
                threshold: 1e-3,
            }),
        ),
        (
            "frozen",
            Box::new(Frozen {
                metric: metric(),
                frame: Frame::Object,
                translation: [true, false, false],
                rotation: [false; 3],
            }),
        ),
        ("gauss-newton", Box::new(GaussNewton::new(metric()))),
        (
            "levenberg-marquardt",
            Box::new(LevenbergMarquardt::new(metric())),
        ),
        (
            "metric-schedule",
            Box::new(MetricSchedule::new(vec![metric(), metric()])),
        ),
        (
            "pose-prior",
            Box::new(PosePrior::new(metric(), prior, 0.01)),
        ),
        (
            "weighted-sum",
            Box::new(WeightedSum {
                terms: ((1.0, metric()),),
            }),
        ),
        (
            "weighted-sum",
            Box::new(WeightedSum {
                terms: vec![(1.0, metric())],
            }),
        ),
    ]
}

fn every_kind() -> Vec<(&'static str, Box<dyn Minimize>)> {
    let mut all = with_kernel(&PointToPoint);
    all.extend(with_kernel(&PointToPlane));
    all.extend(with_kernel(&Symmetric));
    all.extend(with_kernel(&Generalized::default()));
    all
}

/// Returns a decorator with a kernel: it changes the mean, but not the errors of pairs.
fn with_kernel<M: Minimize + Clone + 'static>(
    metric: &M,
) -> Vec<(&'static str, Box<dyn Minimize>)> {
    let mut all = around(metric);
    let robust = Robust::new(metric.clone(), Kernel::TUKEY, Scale::Meters(1e-4));
    all.push(("robust", Box::new(robust)));
    all
}

#[test]
fn errors_of_a_pair_are_those_of_the_metric() {
    let mut numbers = Numbers(23);
    let pairs = messy(&mut numbers, 20);
    let mut inner: [Box<dyn Minimize>; 4] = [
        Box::new(PointToPoint),
        Box::new(PointToPlane),
        Box::new(Symmetric),
        Box::new(Generalized::default()),
    ];
    let squared_errors = |metric: &mut dyn Minimize| {
        let mut errors = vec![0.0; pairs.len()];
        metric.add_squared_errors(&Iteration::default(), &pairs, 1.0, &mut errors);
        errors
    };
    let kinds = every_kind();
    let each = kinds.len() / inner.len();
    for (index, (name, mut wrapped)) in kinds.into_iter().enumerate() {
        assert_eq!(wrapped.label(), name);
        let expected = squared_errors(&mut inner[index / each]);
        assert!(expected.iter().all(|error| *error > 0.0));
        assert_eq!(squared_errors(&mut wrapped), expected, "{name}");
    }
}

/// Losses are those of the metric, except with a prior, which acts once a stage has started.
#[test]
fn losses_are_those_of_the_metric() {
    let mut numbers = Numbers(29);
    let pairs = messy(&mut numbers, 50);
    let expected = PointToPlane.loss(&pairs).unwrap();
    assert!(expected > 0.0);
    for (name, mut wrapped) in around(&PointToPlane) {
        let found = wrapped.loss(&pairs).unwrap();
        assert!((found - expected).abs() < 1e-12 * expected, "{name}");
        let step = wrapped.step(&pairs).unwrap();
        assert!(
            (step.mean_loss - expected).abs() < 1e-12 * expected,
            "{name}"
        );
    }
}

/// Solvers and schedules return the system of the inner metric.
#[test]
fn systems_are_those_of_the_metric() {
    let mut numbers = Numbers(30);
    let pairs = messy(&mut numbers, 50);
    let expected = PointToPlane.normal_equations(&pairs).unwrap();
    let same = ["gauss-newton", "levenberg-marquardt", "metric-schedule"];
    let mut found = 0;
    for (name, mut wrapped) in around(&PointToPlane) {
        let system = wrapped.normal_equations(&pairs).unwrap();
        if same.contains(&name) {
            assert_eq!(system, expected, "{name}");
            found += 1;
        }
    }
    assert_eq!(found, same.len());
}

/// Every inner call receives the iteration that the decorator received.
#[test]
fn the_iteration_reaches_every_metric_inside() {
    let mut numbers = Numbers(31);
    let pairs = messy(&mut numbers, 40);
    let init = numbers.motion(&center(), 20.0, 0.1);
    let iteration = Iteration::new(3, &init, Problem::default());
    let spy = |seen: &Seen| Spy {
        metric: PointToPlane,
        seen: Rc::clone(seen),
    };
    let seen = Seen::default();
    let mut wrapped = around(&spy(&seen));
    let robust = Robust::new(spy(&seen), Kernel::HUBER, Scale::default());
    wrapped.push(("robust", Box::new(robust)));
    wrapped.push(("spy", Box::new(spy(&seen))));
    for (name, metric) in &mut wrapped {
        assert_eq!(metric.label(), *name);
        let mut errors = vec![0.0; pairs.len()];
        type Call<'a> = &'a mut dyn FnMut(&mut dyn Minimize);
        let calls: [Call<'_>; 4] = [
            &mut |metric| assert!(metric.system(&iteration, &pairs).is_some()),
            &mut |metric| assert!(metric.mean_loss(&iteration, &pairs).is_some()),
            &mut |metric| assert!(metric.minimize(&iteration, &pairs).is_some()),
            &mut |metric| metric.add_squared_errors(&iteration, &pairs, 1.0, &mut errors),
        ];
        for call in calls {
            seen.borrow_mut().clear();
            call(&mut **metric);
            let seen = seen.borrow();
            assert!(
                !seen.is_empty() && seen.iter().all(|s| *s == (3, init)),
                "{name}"
            );
        }
    }
    // Every term of a sum with a positive factor is called once.
    let sums: [(usize, Box<dyn Minimize>); 3] = [
        (
            2,
            Box::new(WeightedSum {
                terms: ((1.0, spy(&seen)), (2.0, spy(&seen))),
            }),
        ),
        (
            2,
            Box::new(WeightedSum {
                terms: ((1.0, spy(&seen)), (2.0, spy(&seen)), (0.0, spy(&seen))),
            }),
        ),
        (
            4,
            Box::new(WeightedSum {
                terms: vec![(0.5, spy(&seen)); 4],
            }),
        ),
    ];
    for (count, mut sum) in sums {
        seen.borrow_mut().clear();
        assert!(sum.mean_loss(&iteration, &pairs).is_some());
        assert_eq!(*seen.borrow(), vec![(3, init); count]);
    }
}

#[test]
fn a_schedule_selects_the_metric_of_its_iteration_and_then_the_last() {
    let mut numbers = Numbers(37);
    let pairs = messy(&mut numbers, 20);
    let mut metrics: Vec<Box<dyn Minimize>> = vec![Box::new(PointToPoint), Box::new(PointToPlane)];
    let first = Iteration::default();
    let losses = metrics.iter_mut().map(|m| m.mean_loss(&first, &pairs));
    let expected: Vec<Option<f64>> = losses.collect();
    assert_ne!(expected[0], expected[1]);
    let mut schedule = MetricSchedule::new(metrics);
    for (iteration, which) in [(0, 0), (1, 1), (2, 1), (100, 1), (0, 0)] {
        let iteration = Iteration::new(iteration, &Isometry3::identity(), Problem::default());
        assert_eq!(schedule.mean_loss(&iteration, &pairs), expected[which]);
    }
    // Without metrics, there is no result.
    let mut empty = MetricSchedule::new(Vec::<PointToPoint>::new());
    let mut errors = vec![0.0; pairs.len()];
    empty.add_squared_errors(&first, &pairs, 1.0, &mut errors);
    assert!(errors.iter().all(|error| *error == 0.0));
    assert_eq!(empty.loss(&pairs), None);
    assert!(empty.step(&pairs).is_none() && empty.normal_equations(&pairs).is_none());
}

#[test]
fn metrics_report_their_names() {
    let metrics: [(&str, Box<dyn Minimize>); 5] = [
        ("point-to-point", Box::new(PointToPoint)),
        ("point-to-plane", Box::new(PointToPlane)),
        ("plane-to-point", Box::new(PlaneToPoint)),
        ("symmetric", Box::new(Symmetric)),
        ("generalized", Box::new(Generalized::default())),
    ];
    for (name, metric) in metrics {
        assert_eq!(metric.label(), name);
    }
}

/// Scratch memory of earlier steps is not part of a decorator's value.
#[test]
fn decorators_compare_by_their_options() {
    let pairs = messy(&mut Numbers(9), 40);
    fn unchanged<M: Minimize + Clone + PartialEq>(mut metric: M, pairs: &Correspondences) -> bool {
        let fresh = metric.clone();
        metric.step(pairs).unwrap();
        metric == fresh
    }
    let robust = Robust::new(PointToPlane, Kernel::TUKEY, Scale::default());
    assert!(unchanged(robust.clone(), &pairs));
    assert!(unchanged(GaussNewton::new(PointToPlane), &pairs));
    assert!(unchanged(LevenbergMarquardt::new(PointToPlane), &pairs));
    assert_ne!(robust, Robust::default());
}

/// Point-to-plane that counts the pairs whose squared errors are computed.
struct Counted(Cell<usize>);

impl ErrorMetric for Counted {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        PointToPlane.linearize(pair, system);
    }

    fn squared_error(&self, pair: &Pair) -> f64 {
        self.0.set(self.0.get() + 1);
        PointToPlane.squared_error(pair)
    }
}

/// A policy measures nothing that the metric has already measured.
#[test]
fn a_policy_adds_no_pass_over_the_pairs() {
    fn check<M: Minimize>(metric: M, passes: usize, count: impl Fn(&M) -> usize) {
        let mut numbers = Numbers(110);
        let (iteration, pairs) = (Iteration::default(), messy(&mut numbers, 80));
        let mut metric = Conditioned {
            metric,
            policy: Degeneracy::Freeze,
            threshold: Degeneracy::THRESHOLD,
        };
        let step = metric.minimize(&iteration, &pairs).unwrap();
        assert_eq!(count(&metric.metric), passes * pairs.len());
        // With the same results as from one method after the other.
        let system = metric.system(&iteration, &pairs).unwrap();
        assert_eq!(Some(step.increment), system.solve());
        let mean_loss = metric.mean_loss(&iteration, &pairs).unwrap();
        assert!((step.mean_loss - mean_loss).abs() < 1e-13 * mean_loss);
    }
    check(Counted(Cell::new(0)), 0, |metric| metric.0.get());
    let robust = Robust::new(Counted(Cell::new(0)), Kernel::TUKEY, Scale::default());
    check(robust, 1, |metric| metric.metric.0.get());
}

/// A decorator that reports twice the mean loss.
struct Doubled(PointToPlane);

impl Minimize for Doubled {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        Some(&mut self.0)
    }

    fn mean_loss(&mut self, iteration: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        Some(2.0 * self.0.mean_loss(iteration, pairs)?)
    }
}

/// The mean loss of a policy is that of its metric, also if it is not that of the system.
#[test]
fn a_policy_reports_the_mean_loss_of_a_custom_decorator() {
    let mut numbers = Numbers(111);
    let (iteration, pairs) = (Iteration::default(), messy(&mut numbers, 80));
    let mut metric = Conditioned {
        metric: Doubled(PointToPlane),
        policy: Degeneracy::Freeze,
        threshold: Degeneracy::THRESHOLD,
    };
    let step = metric.minimize(&iteration, &pairs).unwrap();
    assert_eq!(Some(step.mean_loss), metric.mean_loss(&iteration, &pairs));
}
