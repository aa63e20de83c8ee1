//! Python observers.

use std::ops::ControlFlow;

use hybrid_icp::{IterationEvent, Observer, RegimeEvent, StageEvent, Trace};
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::errors::InputError;
use crate::events::{PyIterationEvent, PyRegimeEvent, PyStageEvent};

/// Keeps the trace of a run and passes events on to Python.
pub(crate) struct Watch {
    pub(crate) trace: Trace,
    on_iteration: Option<Py<PyAny>>,
    on_regime: Option<Py<PyAny>>,
    on_stage_end: Option<Py<PyAny>>,
    /// The first exception that a method raised.
    raised: Option<PyErr>,
    stopped: bool,
}

impl Watch {
    /// Takes an object with any of the methods `on_iteration`, `on_regime`, `on_stage_end`, or a callable for iterations.
    pub(crate) fn new(observer: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let mut watch = Self {
            trace: Trace::new(),
            on_iteration: None,
            on_regime: None,
            on_stage_end: None,
            raised: None,
            stopped: false,
        };
        let Some(observer) = observer else {
            return Ok(watch);
        };
        let method = |name| -> PyResult<Option<Py<PyAny>>> {
            Ok(observer.getattr_opt(name)?.map(Bound::unbind))
        };
        watch.on_iteration = method("on_iteration")?;
        watch.on_regime = method("on_regime")?;
        watch.on_stage_end = method("on_stage_end")?;
        let has_methods = watch.on_iteration.is_some()
            || watch.on_regime.is_some()
            || watch.on_stage_end.is_some();
        if !has_methods && observer.is_callable() {
            watch.on_iteration = Some(observer.clone().unbind());
        } else if !has_methods {
            return Err(InputError::new_err(format!(
                "observer is {}, expected a callable or an object with on_iteration, on_regime or on_stage_end",
                crate::array::describe(observer)
            )));
        }
        Ok(watch)
    }

    /// Returns the first exception that the observer raised.
    pub(crate) fn finish(self) -> PyResult<Trace> {
        self.raised.map_or(Ok(self.trace), Err)
    }

    /// Calls a method; `False` and exceptions stop the run.
    fn tell<'py, E>(&mut self, py: Python<'py>, method: &Py<PyAny>, event: E)
    where
        E: IntoPyObject<'py>,
    {
        if self.raised.is_some() {
            return;
        }
        match method.bind(py).call1((event,)) {
            Ok(answer) => {
                let refused = answer
                    .cast::<PyBool>()
                    .is_ok_and(|answer| !answer.is_true());
                self.stopped |= refused;
            }
            Err(error) => self.raised = Some(error),
        }
    }
}

impl Observer for Watch {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        if let Some(method) = self.on_iteration.take() {
            Python::attach(|py| self.tell(py, &method, PyIterationEvent::new(event)));
            self.on_iteration = Some(method);
        }
        if self.stopped || self.raised.is_some() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn on_regime(&mut self, event: &RegimeEvent) {
        self.trace.on_regime(event);
        if let Some(method) = self.on_regime.take() {
            Python::attach(|py| self.tell(py, &method, PyRegimeEvent(*event)));
            self.on_regime = Some(method);
        }
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        self.trace.on_stage_end(event);
        if let Some(method) = self.on_stage_end.take() {
            Python::attach(|py| self.tell(py, &method, PyStageEvent::new(event)));
            self.on_stage_end = Some(method);
        }
    }
}
