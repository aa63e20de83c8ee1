//! Estimates fused while the camera moves.

use std::sync::{Mutex, MutexGuard, PoisonError};

use hybrid_icp::fusion::FusionMethod;
use hybrid_icp::{SequentialEstimator, SequentialEvent, SequentialStep};
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::array;
use crate::errors;
use crate::fusion::{self, PyPoseEstimate};
use crate::model::PyModel;
use crate::observation::PyObservation;
use crate::pipeline::PyPipeline;
use crate::result::pose;

/// Estimates the pose of an object that stands still from images along the path of a moving camera (§V of the paper).
///
/// Each image is registered from the pose fused so far, moved with the camera; what comes out is fused, and is the next start.
///
/// Parameters
/// ----------
/// pipeline : Pipeline
///     Registers each image.
/// method : str
///     How estimates are fused, one of `Fuser.methods()`.
/// model : Model
/// T_co : array_like, shape (4, 4)
///     The rough pose in the first camera frame, camera from object, metres.
/// paper : bool, optional
///     §V to the letter: no gate, covariances e_MVE·I₆ that stay as they are. Otherwise uncertainty is about the object's centre,
///     estimates with an MVE above 0.4 are left out, and symmetric poses are brought together.
#[pyclass(frozen, module = "hybrid_icp", name = "SequentialEstimator")]
pub(crate) struct PySequentialEstimator {
    estimator: Mutex<SequentialEstimator>,
    model: Py<PyModel>,
}

#[pymethods]
#[allow(non_snake_case)]
impl PySequentialEstimator {
    #[new]
    #[pyo3(signature = (pipeline, method, model, T_co, *, paper = false))]
    fn new(
        pipeline: &Bound<'_, PyPipeline>,
        method: &str,
        model: &Bound<'_, PyModel>,
        T_co: &Bound<'_, PyAny>,
        paper: bool,
    ) -> PyResult<Self> {
        let method: FusionMethod = method.parse().map_err(errors::input)?;
        let init = array::motion(T_co, "T_co")?.isometry;
        let stage = pipeline.get().build()?;
        let estimator = if paper {
            SequentialEstimator::paper(stage, method, &init)
        } else {
            SequentialEstimator::for_object(stage, method, &model.get().model, &init)
        };
        Ok(Self {
            estimator: Mutex::new(estimator.map_err(errors::input)?),
            model: model.clone().unbind(),
        })
    }

    /// Takes in an image of the object and how the camera moved since the one before.
    ///
    /// Parameters
    /// ----------
    /// observation : Observation
    /// T_nc : array_like, shape (4, 4), optional
    ///     This image's camera from that of the image before, metres; a camera that stood still if not given.
    /// covariance : array_like, shape (6, 6), optional
    ///     Of the motion: a left perturbation in this image's camera frame.
    ///
    /// Returns
    /// -------
    /// SequentialStep
    #[pyo3(signature = (observation, T_nc = None, covariance = None))]
    fn step(
        &self,
        py: Python<'_>,
        observation: &Bound<'_, PyObservation>,
        T_nc: Option<&Bound<'_, PyAny>>,
        covariance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PySequentialStep> {
        let motion = fusion::motion(T_nc, covariance)?;
        let (model, observation) = (&self.model.get().model, &observation.get().observation);
        Ok(PySequentialStep(py.detach(|| {
            self.locked().step(model, observation, &motion)
        })))
    }

    /// Moves the camera without an image.
    ///
    /// Parameters
    /// ----------
    /// T_nc : array_like, shape (4, 4)
    ///     Next camera from camera, metres.
    /// covariance : array_like, shape (6, 6), optional
    ///     Of the motion.
    #[pyo3(signature = (T_nc, covariance = None))]
    fn move_camera(
        &self,
        py: Python<'_>,
        T_nc: &Bound<'_, PyAny>,
        covariance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let motion = fusion::motion(Some(T_nc), covariance)?;
        py.detach(|| self.locked().move_camera(&motion));
        Ok(())
    }

    /// Forgets everything and starts from a rough pose in the current camera frame.
    ///
    /// Parameters
    /// ----------
    /// T_co : array_like, shape (4, 4)
    ///     Camera from object, metres.
    fn restart(&self, py: Python<'_>, T_co: &Bound<'_, PyAny>) -> PyResult<()> {
        let init = array::motion(T_co, "T_co")?.isometry;
        py.detach(|| self.locked().restart(&init))
            .map_err(errors::input)
    }

    /// The pose in the current camera frame, shape (4, 4), float64, metres: fused, or the initial one while there is no estimate.
    #[getter]
    fn T_co<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let current = py.detach(|| self.locked().camera_from_object());
        pose(py, &current)
    }

    /// The fused estimate in the current camera frame; None before the first.
    #[getter]
    fn estimate(&self, py: Python<'_>) -> Option<PyPoseEstimate> {
        py.detach(|| self.locked().estimate()).map(PyPoseEstimate)
    }
}

impl PySequentialEstimator {
    /// Called without the GIL: another thread may hold the lock for a whole step.
    fn locked(&self) -> MutexGuard<'_, SequentialEstimator> {
        self.estimator
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

/// The object's pose after one image, and how it came about, in the camera frame of that image.
#[pyclass(frozen, module = "hybrid_icp", name = "SequentialStep")]
#[derive(Debug)]
pub(crate) struct PySequentialStep(SequentialStep);

#[pymethods]
#[allow(non_snake_case)]
impl PySequentialStep {
    /// The fused pose, shape (4, 4), float64, metres; the initial one, carried along, while there is no estimate.
    #[getter]
    fn T_co<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pose(py, &self.0.camera_from_object)
    }

    /// Its covariance of ξ = [ρ; φ], shape (6, 6), float64; None while there is no estimate.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let covariance = self.0.covariance.as_ref();
        covariance.map(|m| array::from_matrix6(py, m)).transpose()
    }

    /// Where ICP started, shape (4, 4), float64, metres: what was fused before, moved with the camera.
    #[getter]
    fn T_init<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pose(py, &self.0.init)
    }

    /// What ICP made of this image alone, shape (4, 4), float64, metres.
    #[getter]
    fn T_registered<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pose(py, &self.0.outcome.camera_from_object)
    }

    /// Why the registration ended.
    #[getter]
    fn termination(&self) -> &'static str {
        self.0.outcome.termination.name()
    }

    /// The mean VSD estimate of `T_registered`, where it was scored.
    #[getter]
    fn mve(&self) -> Option<f64> {
        self.0.mve
    }

    /// What became of it: as `Fuser.update` returns, or "no_estimate" or "refused".
    #[getter]
    fn event(&self) -> &'static str {
        match &self.0.event {
            SequentialEvent::Estimated(update) => update.name(),
            SequentialEvent::NoEstimate(_) => "no_estimate",
            SequentialEvent::Refused(_) => "refused",
            _ => "other",
        }
    }

    fn __repr__(&self) -> String {
        let t = &self.0.camera_from_object.translation.vector;
        format!(
            "SequentialStep({}, t = ({:.4}, {:.4}, {:.4}) m)",
            self.event(),
            t.x,
            t.y,
            t.z
        )
    }
}
