//! Error metrics with a fault.

use hicp_testkit::{MetricLaws, check_metric, check_metric_forwards, check_minimize};
use hybrid_icp::core::{Correspondences, Iteration, Pair, Vector3};
use hybrid_icp::metric::{
    ErrorMetric, Minimize, NormalEquations, PointToPlane, PointToPoint, Step,
};

use super::caught;

/// The single fault of a metric.
#[derive(Clone, Copy)]
enum Fault {
    NanLoss,
    WrongSign,
    CameraAxis,
    ForgetsWeights,
    Panics,
    NotItsRows,
    Negative,
    SkipsAsZero,
}

impl ErrorMetric for Fault {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        let (p, c) = (pair.source.point.cast(), pair.target.point.cast::<f64>());
        if matches!(self, Self::SkipsAsZero) && pair.source_index.is_multiple_of(2) {
            return;
        }
        let weight = match self {
            Self::ForgetsWeights => 1.0,
            _ => f64::from(pair.weight),
        };
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let mut residual: f64 = axis.dot(&(p - c));
            if matches!(self, Self::WrongSign) {
                residual = -residual;
            }
            let depth = matches!(self, Self::CameraAxis) && axis.z == 1.0;
            system.add_row(
                &p,
                &axis,
                residual,
                if depth { weight * 9.0 } else { weight },
            );
        }
    }

    fn squared_error(&self, pair: &Pair) -> f64 {
        let mut rows = NormalEquations::new(pair.source.point.cast(), 1.0);
        self.linearize(
            &Pair {
                weight: 1.0,
                ..*pair
            },
            &mut rows,
        );
        rows.loss()
            * if matches!(self, Self::NotItsRows) {
                2.0
            } else {
                1.0
            }
    }

    fn step(&self, pairs: &Correspondences) -> Option<Step> {
        let increment = self.linearize_all(pairs)?.solve()?;
        let mut mean_loss = self.mean_squared_error(pairs)?;
        match self {
            Self::NanLoss => mean_loss = f64::NAN,
            Self::Negative => mean_loss = -1.0,
            Self::Panics => assert!(pairs.len() != 2, "two pairs"),
            _ => {}
        }
        Some(Step {
            increment,
            mean_loss,
        })
    }
}

#[test]
fn broken_metrics_are_detected() {
    let all = MetricLaws::default();
    for (law, fault) in [
        ("the loss is finite", Fault::NanLoss),
        ("the loss is finite and not negative", Fault::Negative),
        ("downhill", Fault::WrongSign),
        ("frame", Fault::CameraAxis),
        ("rows carry the weight", Fault::ForgetsWeights),
        ("never panics", Fault::Panics),
        ("squared_error is the sum", Fault::NotItsRows),
        ("squared_error is NO_ROWS", Fault::SkipsAsZero),
    ] {
        caught(law, || check_metric(|| fault, all));
    }
}

/// A decorator whose loss depends on the number of calls.
#[derive(Clone, Copy)]
struct Stateful(u32);

impl Minimize for Stateful {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        None
    }

    fn system(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<NormalEquations> {
        PointToPlane.linearize_all(pairs)
    }

    fn mean_loss(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        self.0 += 1;
        Some(PointToPlane.mean_squared_error(pairs)? * f64::from(self.0))
    }

    fn add_squared_errors(
        &mut self,
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
        factor: f64,
        errors: &mut [f64],
    ) {
        PointToPlane.add_squared_errors(iteration, pairs, factor, errors);
    }

    fn label(&self) -> &'static str {
        "stateful"
    }
}

#[test]
fn a_decorator_that_counts_its_calls_is_detected() {
    caught("pure", || {
        check_minimize(|| Stateful(0), MetricLaws::default());
    });
}

/// A decorator that states another loss next to the system.
struct OtherLoss;

impl Minimize for OtherLoss {
    fn inner(&mut self, _: &Iteration<'_>) -> Option<&mut dyn Minimize> {
        None
    }

    fn system(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<NormalEquations> {
        PointToPlane.linearize_all(pairs)
    }

    fn mean_loss(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<f64> {
        PointToPlane.mean_squared_error(pairs)
    }

    fn system_and_loss(
        &mut self,
        _: &Iteration<'_>,
        pairs: &Correspondences,
    ) -> Option<(NormalEquations, f64)> {
        let system = PointToPlane.linearize_all(pairs)?;
        Some((system, system.loss()))
    }

    fn minimize(&mut self, _: &Iteration<'_>, pairs: &Correspondences) -> Option<Step> {
        PointToPlane.step(pairs)
    }
}

#[test]
fn a_loss_that_is_not_that_of_the_system_is_detected() {
    caught("system_and_loss returns the mean loss", || {
        check_minimize(|| OtherLoss, MetricLaws::default());
    });
}

/// A wrapper that forwards the required methods but not the provided ones.
struct Unforwarded<M>(M);

impl<M: ErrorMetric> ErrorMetric for Unforwarded<M> {
    fn linearize(&self, pair: &Pair, system: &mut NormalEquations) {
        self.0.linearize(pair, system);
    }
}

#[test]
fn a_wrapper_that_forwards_no_provided_method_is_detected() {
    caught("forwards every method", || {
        check_metric_forwards(|| PointToPoint, || Unforwarded(PointToPoint));
    });
}

/// Checks that the helper of this file passes without a fault, so that the faults themselves are
/// detected.
#[test]
fn components_without_a_fault_pass() {
    check_metric(|| Unforwarded(PointToPlane), MetricLaws::default());
}
