//! What stands around a metric passes on what it does not change.

use std::cell::RefCell;
use std::rc::Rc;

use crate::scenes::{Numbers, center, messy};
use hicp_core::{Isometry3, Pair};
use hicp_metric::{
    Conditioned, Degeneracy, ErrorMetric, Frame, Frozen, GaussNewton, Generalized, Kernel,
    LevenbergMarquardt, MetricSchedule, NormalEquations, PlaneToPoint, PointToPlane, PointToPoint,
    PosePrior, Prior, Robust, Scale, Symmetric, WeightedSum,
};

type Begun = Rc<RefCell<Vec<(usize, Isometry3<f64>)>>>;

/// A metric that tells what it was told.
#[derive(Clone)]
struct Spy<M> {
    metric: M,
    begun: Begun,
}

impl<M: ErrorMetric> ErrorMetric for Spy<M> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        self.metric.linearize(pair, system);
    }
    fn squared_error(&self, pair: &Pair) -> f64 {
        self.metric.squared_error(pair)
    }
    fn begin(&mut self, iteration: usize, init: &Isometry3<f64>) {
        self.begun.borrow_mut().push((iteration, *init));
    }
    fn name(&self) -> &'static str {
        "spy"
    }
}

/// What stands around one metric, by the name that it states, and changes neither a pair's error nor the mean of all.
fn around<M: ErrorMetric + Clone + 'static>(
    metric: &M,
) -> Vec<(&'static str, Box<dyn ErrorMetric>)> {
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

fn every_kind() -> Vec<(&'static str, Box<dyn ErrorMetric>)> {
    let mut all = with_kernel(&PointToPoint);
    all.extend(with_kernel(&PointToPlane));
    all.extend(with_kernel(&Symmetric));
    all.extend(with_kernel(&Generalized::default()));
    all
}

/// A kernel belongs to the set of pairs: it changes the mean, but no pair's own error.
fn with_kernel<M: ErrorMetric + Clone + 'static>(
    metric: &M,
) -> Vec<(&'static str, Box<dyn ErrorMetric>)> {
    let mut all = around(metric);
    let robust = Robust::new(metric.clone(), Kernel::TUKEY, Scale::Meters(1e-4));
    all.push(("robust", Box::new(robust)));
    all
}

#[test]
fn errors_and_rows_of_a_pair_are_those_of_the_metric() {
    let mut numbers = Numbers(23);
    let pairs = messy(&mut numbers, 20);
    let inner: [Box<dyn ErrorMetric>; 4] = [
        Box::new(PointToPoint),
        Box::new(PointToPlane),
        Box::new(Symmetric),
        Box::new(Generalized::default()),
    ];
    let kinds = every_kind();
    let each = kinds.len() / inner.len();
    for (index, (name, wrapped)) in kinds.iter().enumerate() {
        let inner = &inner[index / each];
        assert_eq!(wrapped.name(), *name);
        for pair in pairs.as_slice() {
            let expected = inner.squared_error(pair);
            assert_eq!(
                wrapped.squared_error(pair).to_bits(),
                expected.to_bits(),
                "{name}"
            );
            let rows = |metric: &dyn ErrorMetric| {
                let mut system = NormalEquations::new(center(), 0.1);
                metric.linearize(pair, &mut system);
                system
            };
            let (found, expected) = (rows(&**wrapped), rows(&**inner));
            assert!(expected.rows() > 0 && expected.loss() > 0.0);
            assert_eq!(found, expected, "{name}");
        }
    }
}

/// The loss of the pairs too, but where there is a prior, and that only once a stage has begun.
#[test]
fn losses_are_those_of_the_metric() {
    let mut numbers = Numbers(29);
    let pairs = messy(&mut numbers, 50);
    let expected = PointToPlane.mean_loss(&pairs).unwrap();
    assert!(expected > 0.0);
    for (name, mut wrapped) in around(&PointToPlane) {
        let found = wrapped.mean_loss(&pairs).unwrap();
        assert!((found - expected).abs() < 1e-12 * expected, "{name}");
        let step = wrapped.minimize(&pairs).unwrap();
        assert!(
            (step.mean_loss - expected).abs() < 1e-12 * expected,
            "{name}"
        );
    }
}

/// What iterates or takes turns asks the metric inside what the pairs determine.
#[test]
fn systems_are_those_of_the_metric() {
    let mut numbers = Numbers(30);
    let pairs = messy(&mut numbers, 50);
    let expected = PointToPlane.system(&pairs).unwrap();
    let same = ["gauss-newton", "levenberg-marquardt", "metric-schedule"];
    let mut found = 0;
    for (name, mut wrapped) in around(&PointToPlane) {
        let system = wrapped.system(&pairs).unwrap();
        if same.contains(&name) {
            assert_eq!(system, expected, "{name}");
            found += 1;
        }
    }
    assert_eq!(found, same.len());
}

#[test]
fn the_beginning_of_an_iteration_reaches_every_metric_inside() {
    let mut numbers = Numbers(31);
    let init = numbers.motion(&center(), 20.0, 0.1);
    let spy = |begun: &Begun| Spy {
        metric: PointToPlane,
        begun: Rc::clone(begun),
    };
    let begun = Begun::default();
    let mut wrapped = around(&spy(&begun));
    let robust = Robust::new(spy(&begun), Kernel::HUBER, Scale::default());
    wrapped.push(("robust", Box::new(robust)));
    let boxed: Box<dyn ErrorMetric> = Box::new(spy(&begun));
    wrapped.push(("spy", Box::new(boxed)));
    for (name, metric) in &mut wrapped {
        assert_eq!(metric.name(), *name);
        begun.borrow_mut().clear();
        metric.begin(3, &init);
        let told = if *name == "metric-schedule" { 2 } else { 1 };
        assert_eq!(*begun.borrow(), vec![(3, init); told], "{name}");
    }
    // Every term of a sum.
    let sums: [(usize, Box<dyn ErrorMetric>); 3] = [
        (
            2,
            Box::new(WeightedSum {
                terms: ((1.0, spy(&begun)), (2.0, spy(&begun))),
            }),
        ),
        (
            3,
            Box::new(WeightedSum {
                terms: ((1.0, spy(&begun)), (2.0, spy(&begun)), (0.0, spy(&begun))),
            }),
        ),
        (
            4,
            Box::new(WeightedSum {
                terms: vec![(0.5, spy(&begun)); 4],
            }),
        ),
    ];
    for (count, mut sum) in sums {
        begun.borrow_mut().clear();
        sum.begin(0, &init);
        assert_eq!(*begun.borrow(), vec![(0, init); count]);
    }
}

#[test]
fn a_schedule_takes_the_metric_of_its_iteration_and_stays_at_the_last() {
    let mut numbers = Numbers(37);
    let pairs = messy(&mut numbers, 20);
    let pair = &pairs.as_slice()[0];
    let metrics: Vec<Box<dyn ErrorMetric>> = vec![Box::new(PointToPoint), Box::new(PointToPlane)];
    let expected: Vec<f64> = metrics.iter().map(|m| m.squared_error(pair)).collect();
    assert_ne!(expected[0], expected[1]);
    let mut schedule = MetricSchedule::new(metrics);
    for (iteration, which) in [(0, 0), (1, 1), (2, 1), (100, 1), (0, 0)] {
        schedule.begin(iteration, &Isometry3::identity());
        assert_eq!(schedule.squared_error(pair), expected[which]);
    }
    // Without any it measures nothing.
    let mut empty = MetricSchedule::new(Vec::<PointToPoint>::new());
    assert_eq!(empty.squared_error(pair), 0.0);
    assert_eq!(empty.mean_loss(&pairs), None);
    assert!(empty.minimize(&pairs).is_none() && empty.system(&pairs).is_none());
}

#[test]
fn metrics_say_their_names() {
    let metrics: [(&str, Box<dyn ErrorMetric>); 5] = [
        ("point-to-point", Box::new(PointToPoint)),
        ("point-to-plane", Box::new(PointToPlane)),
        ("plane-to-point", Box::new(PlaneToPoint)),
        ("symmetric", Box::new(Symmetric)),
        ("generalized", Box::new(Generalized::default())),
    ];
    for (name, metric) in metrics {
        assert_eq!(metric.name(), name);
    }
}
