//! Events for observers.

use hybrid_icp::StageRecord;
use hybrid_icp::icp::{IterationEvent, RegimeEvent, StageEvent, Verdict};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::Matrix;

/// One iteration, with the pose that was evaluated.
#[pyclass(frozen, get_all, module = "hybrid_icp", name = "IterationEvent")]
#[derive(Debug)]
#[allow(non_snake_case)]
pub(crate) struct PyIterationEvent {
    /// Iteration within the stage, from 0.
    iteration: usize,
    /// The pose evaluated, camera from object, shape (4, 4), float64, meters.
    T_co: Matrix,
    /// The increment found at that pose, shape (4, 4), float64, meters. The next pose is
    /// `increment @ T_co`.
    increment: Matrix,
    /// Number of pairs after filtering.
    n_pairs: usize,
    /// Weighted mean of the metric's squared residuals, m².
    mean_loss: f64,
}

impl PyIterationEvent {
    pub(crate) fn new(event: &IterationEvent<'_>) -> Self {
        Self {
            iteration: event.iteration,
            T_co: event.camera_from_object.into(),
            increment: event.increment.into(),
            n_pairs: event.evaluation.n_pairs,
            mean_loss: event.evaluation.mean_loss,
        }
    }
}

#[pymethods]
impl PyIterationEvent {
    fn __repr__(&self) -> String {
        format!(
            "IterationEvent(iteration {}, {} pairs, mean loss {:e} m²)",
            self.iteration, self.n_pairs, self.mean_loss
        )
    }
}

/// A switcher's choice.
#[pyclass(frozen, get_all, module = "hybrid_icp", name = "RegimeEvent")]
#[derive(Debug)]
pub(crate) struct PyRegimeEvent {
    /// The selected branch: "aligned", "misaligned" or "regime-N".
    regime: &'static str,
    /// The score that decided, if there is one.
    score: Option<f64>,
}

impl PyRegimeEvent {
    pub(crate) fn new(event: &RegimeEvent) -> Self {
        Self {
            regime: event.regime.name(),
            score: event.score,
        }
    }
}

#[pymethods]
impl PyRegimeEvent {
    fn __repr__(&self) -> String {
        match self.score {
            Some(score) => format!("RegimeEvent({}, score {score:.3})", self.regime),
            None => format!("RegimeEvent({})", self.regime),
        }
    }
}

/// An ICP stage that ended.
#[pyclass(frozen, get_all, module = "hybrid_icp", name = "StageEvent")]
#[derive(Debug)]
#[allow(non_snake_case)]
pub(crate) struct PyStageEvent {
    /// The branch that the switcher selected, if this is the first stage after a choice.
    ///
    /// Always None in an observer.
    regime: Option<&'static str>,
    /// The MVE for which it was selected.
    regime_mve: Option<f64>,
    /// Name of the point selection.
    selection: &'static str,
    /// Name of the data association.
    association: &'static str,
    /// Names of the outlier filters and weights, in order.
    filters: Vec<&'static str>,
    /// Name of the error metric.
    metric: &'static str,
    /// Names of the stop rules, in order.
    stop_rules: Vec<&'static str>,
    /// Number of points selected.
    n_source: usize,
    /// The pose that the stage returned, camera from object, shape (4, 4), float64, meters.
    T_co: Matrix,
    /// "refined", or "kept_initial" if the stage returned the pose that it started from.
    outcome: &'static str,
    /// The reason why the stage ended.
    termination: &'static str,
    /// Number of evaluations, including rejected ones.
    iterations: usize,
    /// Number of pairs at the pose that was returned.
    n_pairs: usize,
    /// Weighted mean of the metric's squared residuals at that pose, m²; None if it was never
    /// evaluated.
    mean_loss: Option<f64>,
}

impl From<&StageRecord> for PyStageEvent {
    fn from(record: &StageRecord) -> Self {
        let outcome = &record.outcome;
        Self {
            regime: record.switched.map(|event| event.regime.name()),
            regime_mve: record.switched.and_then(|event| event.score),
            selection: record.selection,
            association: record.association,
            filters: record.filters.clone(),
            metric: record.metric,
            stop_rules: record.stop_rules.clone(),
            n_source: record.n_source,
            T_co: (&outcome.camera_from_object).into(),
            outcome: name(outcome.verdict),
            termination: outcome.termination.name(),
            iterations: outcome.iterations,
            n_pairs: outcome.n_pairs(),
            mean_loss: outcome.evaluation.map(|e| e.mean_loss),
        }
    }
}

impl PyStageEvent {
    pub(crate) fn new(event: &StageEvent<'_>) -> Self {
        Self::from(&StageRecord::from(event))
    }
}

/// Returns the name of a verdict, as in the reports of the program.
pub(crate) fn name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Refined => "refined",
        Verdict::KeptInitial(_) => "kept_initial",
    }
}

#[pymethods]
impl PyStageEvent {
    /// Returns all attributes except the pose as plain Python values.
    ///
    /// Returns
    /// -------
    /// dict
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let names = [
            "regime",
            "regime_mve",
            "selection",
            "association",
            "filters",
            "metric",
            "stop_rules",
            "n_source",
            "iterations",
            "n_pairs",
            "mean_loss",
            "termination",
            "outcome",
        ];
        plain(slf, &names)
    }

    fn __repr__(&self) -> String {
        format!(
            "StageEvent({}, {}, {}: {} iterations, {} pairs, {})",
            self.selection,
            self.association,
            self.metric,
            self.iterations,
            self.n_pairs,
            self.termination
        )
    }
}

/// Returns attributes as plain Python values that `json.dumps` accepts. Arrays become nested lists.
pub(crate) fn plain<'py>(
    object: &Bound<'py, PyAny>,
    names: &[&str],
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(object.py());
    for name in names {
        let value = object.getattr(*name)?;
        let value = match value.getattr_opt("tolist")? {
            Some(to_list) => to_list.call0()?,
            None => value,
        };
        dict.set_item(name, value)?;
    }
    Ok(dict)
}
