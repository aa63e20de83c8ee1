//! What observers are told.

use hybrid_icp::{Evaluation, Isometry3, IterationEvent, RegimeEvent, StageEvent, StageRecord};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::result::{pose, verdict};

/// An iteration: a pose that was evaluated.
#[pyclass(frozen, module = "hybrid_icp", name = "IterationEvent")]
#[derive(Debug)]
pub(crate) struct PyIterationEvent {
    /// Iteration within the stage, from 0.
    #[pyo3(get)]
    iteration: usize,
    camera_from_object: Isometry3<f64>,
    increment: Isometry3<f64>,
    evaluation: Evaluation,
}

impl PyIterationEvent {
    pub(crate) fn new(event: &IterationEvent<'_>) -> Self {
        Self {
            iteration: event.iteration,
            camera_from_object: *event.camera_from_object,
            increment: *event.increment,
            evaluation: event.evaluation,
        }
    }
}

#[pymethods]
#[allow(non_snake_case)]
impl PyIterationEvent {
    /// The pose evaluated, camera from object, shape (4, 4), float64, metres.
    #[getter]
    fn T_co<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pose(py, &self.camera_from_object)
    }

    /// The increment found there, shape (4, 4), float64, metres: the next pose is `increment @ T_co`.
    #[getter]
    fn increment<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pose(py, &self.increment)
    }

    /// Number of pairs after filtering.
    #[getter]
    fn n_pairs(&self) -> usize {
        self.evaluation.n_pairs
    }

    /// Weighted mean of the metric's squared residuals, m².
    #[getter]
    fn mean_loss(&self) -> f64 {
        self.evaluation.mean_loss
    }

    fn __repr__(&self) -> String {
        format!(
            "IterationEvent(iteration {}, {} pairs, mean loss {:e} m²)",
            self.iteration, self.evaluation.n_pairs, self.evaluation.mean_loss
        )
    }
}

/// A switcher's choice.
#[pyclass(frozen, module = "hybrid_icp", name = "RegimeEvent")]
#[derive(Debug)]
pub(crate) struct PyRegimeEvent(pub(crate) RegimeEvent);

#[pymethods]
impl PyRegimeEvent {
    /// The branch taken: "aligned", "misaligned" or "regime-N".
    #[getter]
    fn regime(&self) -> &'static str {
        self.0.regime.name()
    }

    /// The score that decided, if there is one.
    #[getter]
    fn score(&self) -> Option<f64> {
        self.0.score
    }

    fn __repr__(&self) -> String {
        match self.0.score {
            Some(score) => format!("RegimeEvent({}, score {score:.3})", self.regime()),
            None => format!("RegimeEvent({})", self.regime()),
        }
    }
}

/// An ICP stage that ended.
#[pyclass(frozen, module = "hybrid_icp", name = "StageEvent")]
#[derive(Debug)]
pub(crate) struct PyStageEvent(StageRecord);

impl PyStageEvent {
    pub(crate) fn of_record(record: &StageRecord) -> Self {
        Self(record.clone())
    }

    pub(crate) fn new(event: &StageEvent<'_>) -> Self {
        Self(StageRecord::from(event))
    }
}

#[pymethods]
#[allow(non_snake_case)]
impl PyStageEvent {
    /// What the switch chose before this stage, if it was the first to run after a choice; always None in an observer.
    #[getter]
    fn regime(&self) -> Option<&'static str> {
        self.0.switched.map(|event| event.regime.name())
    }

    /// The MVE that the switch chose by, likewise.
    #[getter]
    fn regime_mve(&self) -> Option<f64> {
        self.0.switched.and_then(|event| event.score)
    }

    /// Name of the point selection.
    #[getter]
    fn selection(&self) -> &'static str {
        self.0.selection
    }

    /// Name of the data association.
    #[getter]
    fn association(&self) -> &'static str {
        self.0.association
    }

    /// Names of the outlier filters and weights, in order.
    #[getter]
    fn filters(&self) -> Vec<&'static str> {
        self.0.filters.clone()
    }

    /// Names of the stop rules, in order.
    #[getter]
    fn stop_rules(&self) -> Vec<&'static str> {
        self.0.stop_rules.clone()
    }

    /// Name of the error metric.
    #[getter]
    fn metric(&self) -> &'static str {
        self.0.metric
    }

    /// Number of points selected.
    #[getter]
    fn n_source(&self) -> usize {
        self.0.n_source
    }

    /// The pose that the stage returned, camera from object, shape (4, 4), float64, metres.
    #[getter]
    fn T_co<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pose(py, &self.0.outcome.camera_from_object)
    }

    /// "refined", or "kept_initial" when the stage returned the pose that it started from.
    #[getter]
    fn outcome(&self) -> &'static str {
        verdict(self.0.outcome.verdict)
    }

    /// Why the stage ended.
    #[getter]
    fn termination(&self) -> &'static str {
        self.0.outcome.termination.name()
    }

    /// Number of evaluations, rejected ones included.
    #[getter]
    fn iterations(&self) -> usize {
        self.0.outcome.iterations
    }

    /// Number of pairs at the pose that was returned.
    #[getter]
    fn n_pairs(&self) -> usize {
        self.0.outcome.n_pairs()
    }

    /// Weighted mean of the metric's squared residuals there, m²; None if it was never evaluated.
    #[getter]
    fn mean_loss(&self) -> Option<f64> {
        self.0.outcome.evaluation.map(|e| e.mean_loss)
    }

    /// Returns everything but the pose as plain Python values.
    ///
    /// Returns
    /// -------
    /// dict
    pub(crate) fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("regime", self.regime())?;
        dict.set_item("regime_mve", self.regime_mve())?;
        dict.set_item("selection", self.selection())?;
        dict.set_item("association", self.association())?;
        dict.set_item("filters", self.filters())?;
        dict.set_item("metric", self.metric())?;
        dict.set_item("stop_rules", self.stop_rules())?;
        dict.set_item("n_source", self.n_source())?;
        dict.set_item("iterations", self.iterations())?;
        dict.set_item("n_pairs", self.n_pairs())?;
        dict.set_item("mean_loss", self.mean_loss())?;
        dict.set_item("termination", self.termination())?;
        dict.set_item("outcome", self.outcome())?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        format!(
            "StageEvent({}, {}, {}: {} iterations, {} pairs, {})",
            self.selection(),
            self.association(),
            self.metric(),
            self.iterations(),
            self.n_pairs(),
            self.termination()
        )
    }
}
