//! Results and events: the dataclasses of `hybrid_icp._results`, and their values.

use std::collections::BTreeMap;

use hybrid_icp::icp::{
    Alternative, DecisionEvent, IterationEvent, Outcome, Quality, RegimeEvent, StageEvent, Verdict,
};
use hybrid_icp::{
    Alignment, Diagnosis, Finding, Refinement, SequentialEvent, SequentialStep, StageRecord,
    Tracked,
};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{Matrix, Motion};
use crate::input::model::PyModel;

/// An instance of a dataclass of `hybrid_icp._results`.
pub(crate) type Record<'py> = PyResult<Bound<'py, PyAny>>;

/// Creates an instance of a dataclass from its fields.
macro_rules! record {
    ($py:expr, $class:ident { $($field:ident: $value:expr),* $(,)? }) => {{
        let fields = pyo3::types::PyDict::new($py);
        $(fields.set_item(stringify!($field), $value)?;)*
        crate::results::create($py, stringify!($class), &fields)
    }};
}
pub(crate) fn create<'py>(
    py: Python<'py>,
    class: &str,
    fields: &Bound<'py, PyDict>,
) -> Record<'py> {
    let module = py.import("hybrid_icp._results")?;
    module.getattr(class)?.call((), Some(fields))
}

/// Returns the pose of an outcome. An initial pose has the numbers that were passed, which can be
/// orthogonal only to their precision.
fn pose(outcome: &Outcome, init: &Motion) -> Matrix {
    match outcome.verdict {
        Verdict::Refined => (&outcome.camera_from_object).into(),
        Verdict::KeptInitial(_) => Matrix::new(4, init.matrix.to_vec()),
    }
}

fn texts<T: ToString>(items: &[T]) -> Vec<String> {
    items.iter().map(ToString::to_string).collect()
}

pub(crate) fn iteration<'py>(py: Python<'py>, event: &IterationEvent<'_>) -> Record<'py> {
    record!(
        py,
        IterationEvent {
            iteration: event.iteration,
            T_co: Matrix::from(event.camera_from_object),
            increment: Matrix::from(event.increment),
            n_pairs: event.evaluation.n_pairs,
            mean_loss: event.evaluation.mean_loss,
        }
    )
}

pub(crate) fn regime<'py>(py: Python<'py>, event: &RegimeEvent) -> Record<'py> {
    record!(
        py,
        RegimeEvent {
            regime: event.regime.name(),
            score: event.score
        }
    )
}

pub(crate) fn decision<'py>(py: Python<'py>, event: &DecisionEvent<'_>) -> Record<'py> {
    record!(
        py,
        DecisionEvent {
            stage: event.stage,
            T_co: Matrix::from(event.camera_from_object),
            score: event.score,
            best: event.best,
            kept: event.kept,
        }
    )
}

pub(crate) fn stage_event<'py>(py: Python<'py>, event: &StageEvent<'_>) -> Record<'py> {
    stage(py, &StageRecord::from(event))
}

fn stage<'py>(py: Python<'py>, record: &StageRecord) -> Record<'py> {
    let outcome = &record.outcome;
    record!(
        py,
        StageEvent {
            regime: record.switched.map(|event| event.regime.name()),
            regime_mve: record.switched.and_then(|event| event.score),
            selection: record.selection,
            association: record.association,
            filters: record.filters.clone(),
            metric: record.metric,
            stop_rules: record.stop_rules.clone(),
            n_source: record.n_source,
            T_co: Matrix::from(&outcome.camera_from_object),
            outcome: outcome.verdict.name(),
            termination: outcome.termination.name(),
            iterations: outcome.iterations,
            n_pairs: outcome.n_pairs(),
            mean_loss: outcome.evaluation.map(|e| e.mean_loss),
        }
    )
}

fn alternative<'py>(py: Python<'py>, other: &Alternative) -> Record<'py> {
    record!(
        py,
        Alternative {
            T_co: Matrix::from(&other.camera_from_object),
            score: other.score,
            gap: other.gap,
            color_gap: other.color_gap,
            mssd: other.mssd_meters,
            rotation_degrees: other.rotation_degrees,
        }
    )
}

/// Creates the result of a refinement of `model` from the pose `init`.
pub(crate) fn result<'py>(
    model: &Bound<'py, PyModel>,
    init: &Motion,
    refinement: &Refinement,
    stages: &[StageRecord],
    others: &[Alternative],
) -> Record<'py> {
    let py = model.py();
    let outcome = &refinement.outcome;
    let quality = outcome.quality.as_ref();
    let matrix = |of: fn(&Quality) -> Option<_>| quality.and_then(of).as_ref().map(Matrix::from);
    let stages: PyResult<Vec<_>> = stages.iter().map(|record| stage(py, record)).collect();
    let others: PyResult<Vec<_>> = others.iter().map(|other| alternative(py, other)).collect();
    record!(
        py,
        Result {
            T_co: pose(outcome, init),
            confidence: refinement.confidence,
            expected_error_meters: refinement.expected_error_meters,
            expected_error_degrees: refinement.expected_error_degrees,
            look_alikes: refinement.look_alikes,
            mve: refinement.mve,
            mve_initial: refinement.mve_initial,
            evidence: BTreeMap::from(refinement.evidence.named()),
            warnings: texts(&refinement.warnings()),
            alternatives: others?,
            outcome: outcome.verdict.name(),
            termination: outcome.termination.name(),
            iterations: outcome.iterations,
            n_pairs: outcome.n_pairs(),
            mean_loss: outcome.evaluation.map(|e| e.mean_loss),
            fitness: quality.map(|q| q.fitness),
            point_rmse: quality.map(|q| q.point_rmse),
            plane_rmse: quality.map(|q| q.plane_rmse),
            information: matrix(Quality::information),
            covariance: matrix(Quality::covariance),
            stages: stages?,
            model: model,
        }
    )
}

/// Creates the result of a registration of clouds from the pose `init`.
pub(crate) fn alignment<'py>(
    py: Python<'py>,
    alignment: &Alignment,
    init: &Motion,
    warnings: Vec<String>,
) -> Record<'py> {
    let outcome = &alignment.outcome;
    record!(
        py,
        Alignment {
            T_ts: pose(outcome, init),
            outcome: outcome.verdict.name(),
            termination: outcome.termination.name(),
            iterations: outcome.iterations,
            fitness: alignment.fitness(),
            rmse: alignment.rmse(),
            covariance: alignment.covariance().as_ref().map(Matrix::from),
            warnings: warnings,
        }
    )
}

/// Returns a finding as a `Fault`.
fn fault<'py>(py: Python<'py>, finding: &Finding) -> Record<'py> {
    let text = serde_json::to_string(&finding.fault)
        .unwrap_or_else(|error| unreachable!("a fault is plain JSON: {error}"));
    let numbers = py.import("json")?.call_method1("loads", (text,))?;
    record!(
        py,
        Fault {
            fault: numbers.call_method1("pop", ("fault",))?,
            problem: finding.fault.to_string(),
            fix: finding.fault.fix(),
            score: finding.score,
            numbers: numbers,
        }
    )
}

pub(crate) fn diagnosis<'py>(py: Python<'py>, diagnosis: &Diagnosis) -> Record<'py> {
    let faults: PyResult<Vec<_>> = (diagnosis.findings.iter().map(|f| fault(py, f))).collect();
    record!(
        py,
        Diagnosis {
            faults: faults?,
            score: diagnosis.score,
        }
    )
}

pub(crate) fn tracked<'py>(py: Python<'py>, tracked: &Tracked) -> Record<'py> {
    record!(
        py,
        Tracked {
            T_co: Matrix::from(&tracked.camera_from_object),
            state: tracked.state.name(),
            confidence: tracked.confidence,
            velocity: PyArray1::from_slice(py, tracked.meters_per_second.as_slice()),
            angular_velocity: PyArray1::from_slice(py, tracked.radians_per_second.as_slice()),
            evidence: BTreeMap::from(tracked.evidence.named()),
            deviation: tracked.deviation_meters,
        }
    )
}

/// Creates the step of a sequential estimator.
pub(crate) fn sequential_step<'py>(py: Python<'py>, step: &SequentialStep) -> Record<'py> {
    record!(
        py,
        SequentialStep {
            T_co: Matrix::from(&step.camera_from_object),
            covariance: step.covariance.as_ref().map(Matrix::from),
            T_init: Matrix::from(&step.init),
            T_registered: Matrix::from(&step.outcome.camera_from_object),
            termination: step.outcome.termination.name(),
            mve: step.mve,
            event: match &step.event {
                SequentialEvent::Estimated(update) => update.name(),
                SequentialEvent::NoEstimate(_) => "no_estimate",
                SequentialEvent::Refused(_) => "refused",
                _ => "other",
            },
            reason: step.event.reason(),
        }
    )
}
