//! Passes events to Python observers.

use std::ops::ControlFlow;

use hybrid_icp::Trace;
use hybrid_icp::icp::{DecisionEvent, IterationEvent, Observer, RegimeEvent, StageEvent};
use pyo3::prelude::*;

use crate::errors::InputError;
use crate::results::{self, Record};

/// The methods of an observer, in the order of [`Watch::methods`].
const METHODS: [&str; 4] = ["on_iteration", "on_regime", "on_decision", "on_stage_end"];

/// Records the trace of a run and passes its events to Python.
pub(crate) struct Watch {
    pub(crate) trace: Trace,
    methods: [Option<Py<PyAny>>; METHODS.len()],
    /// The first exception that a method raised.
    raised: Option<PyErr>,
    stopped: bool,
}

impl Watch {
    /// Creates a watch for an object with any of the [`METHODS`], or for a callable that receives
    /// the iterations.
    pub(crate) fn new(observer: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let mut methods = [const { None }; METHODS.len()];
        if let Some(observer) = observer {
            for (method, name) in methods.iter_mut().zip(METHODS) {
                *method = observer.getattr_opt(name)?.map(Bound::unbind);
            }
            if methods.iter().all(Option::is_none) {
                if !observer.is_callable() {
                    return Err(InputError::new_err(format!(
                        "observer is {}, expected a callable or an object with on_iteration, on_regime, \
                         on_decision or on_stage_end",
                        crate::array::describe(observer)
                    )));
                }
                methods[0] = Some(observer.clone().unbind());
            }
        }
        Ok(Self {
            trace: Trace::new(),
            methods,
            raised: None,
            stopped: false,
        })
    }

    /// Returns the first exception that the observer raised, or the trace.
    pub(crate) fn finish(self) -> PyResult<Trace> {
        self.raised.map_or(Ok(self.trace), Err)
    }

    /// Calls a method. `False` and exceptions stop the run.
    fn call(&mut self, method: usize, event: impl for<'py> FnOnce(Python<'py>) -> Record<'py>) {
        let (Some(method), None) = (&self.methods[method], &self.raised) else {
            return;
        };
        Python::attach(|py| {
            let answer = event(py).and_then(|event| method.bind(py).call1((event,)));
            match answer.and_then(|answer| goes_on(&answer)) {
                Ok(goes_on) => self.stopped |= !goes_on,
                Err(error) => self.raised = Some(error),
            }
        });
    }
}

/// Reads the answer of an observer: a bool of Python or NumPy, or None to go on.
fn goes_on(answer: &Bound<'_, PyAny>) -> PyResult<bool> {
    // Extraction also accepts `numpy.bool_`.
    match answer.extract() {
        Ok(goes_on) => Ok(goes_on),
        Err(_) if answer.is_none() => Ok(true),
        Err(_) => Err(InputError::new_err(format!(
            "the observer returned {}, expected True, None, or False to stop",
            crate::array::describe(answer)
        ))),
    }
}

impl Observer for Watch {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        self.call(0, |py| results::iteration(py, event));
        if self.stopped || self.raised.is_some() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn on_regime(&mut self, event: &RegimeEvent) {
        self.trace.on_regime(event);
        self.call(1, |py| results::regime(py, event));
    }

    fn on_decision(&mut self, event: &DecisionEvent<'_>) {
        self.call(2, |py| results::decision(py, event));
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        self.trace.on_stage_end(event);
        self.call(3, |py| results::stage_event(py, event));
    }
}
