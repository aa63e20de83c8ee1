//! Estimates fused while the camera moves.

use std::sync::Mutex;

use hybrid_icp::fusion::FusionMethod;
use hybrid_icp::{SequentialEstimator, SequentialEvent, SequentialStep};
use pyo3::prelude::*;

use crate::array::{self, Matrix};
use crate::errors;
use crate::fusion::{self, PyPoseEstimate};
use crate::model::PyModel;
use crate::mutex::locked;
use crate::observation::PyObservation;
use crate::pipeline::PyPipeline;

/// Estimates the pose of an object that stands still from images along the path of a moving camera
/// (§V of the paper).
///
/// Each image is registered from the pose fused so far, moved with the camera; what comes out is
/// fused, and is the next start.
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
///     §V to the letter: no gate, covariances e_MVE·I₆ that stay as they are. Otherwise uncertainty
///     is about the object's centre, estimates with an MVE above 0.4 are left out, and symmetric
///     poses are brought together.
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
    ///     This image's camera from that of the image before, metres; a camera that stood still if
    ///     not given.
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
        // Without the GIL: another thread may hold the lock for a whole step.
        let step = py.detach(|| locked(&self.estimator).step(model, observation, &motion));
        Ok(PySequentialStep::new(&step))
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
        py.detach(|| locked(&self.estimator).move_camera(&motion));
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
        py.detach(|| locked(&self.estimator).restart(&init))
            .map_err(errors::input)
    }

    /// The pose in the current camera frame, shape (4, 4), float64, metres: fused, or the initial
    /// one while there is no estimate.
    #[getter]
    fn T_co(&self, py: Python<'_>) -> Matrix {
        (&py.detach(|| locked(&self.estimator).camera_from_object())).into()
    }

    /// The fused estimate in the current camera frame; None before the first.
    #[getter]
    fn estimate(&self, py: Python<'_>) -> Option<PyPoseEstimate> {
        py.detach(|| locked(&self.estimator).estimate())
            .map(PyPoseEstimate)
    }
}

/// The object's pose after one image and how it was estimated, in the camera frame of that image.
#[pyclass(frozen, get_all, module = "hybrid_icp", name = "SequentialStep")]
#[derive(Debug)]
#[allow(non_snake_case)]
pub(crate) struct PySequentialStep {
    /// The fused pose, shape (4, 4), float64, metres. While there is no estimate, the initial pose,
    /// moved with the camera.
    T_co: Matrix,
    /// Its covariance of ξ = [ρ; φ], shape (6, 6), float64; None while there is no estimate.
    covariance: Option<Matrix>,
    /// The pose that ICP started from, shape (4, 4), float64, metres: the last fused pose, moved
    /// with the camera.
    T_init: Matrix,
    /// The pose that ICP found in this image alone, shape (4, 4), float64, metres.
    T_registered: Matrix,
    /// Why the registration ended.
    termination: &'static str,
    /// The mean VSD estimate of `T_registered`; None if it was not scored.
    mve: Option<f64>,
    /// One word for the result: as `Fuser.update` returns, or "no_estimate" or "refused".
    event: &'static str,
}

impl PySequentialStep {
    fn new(step: &SequentialStep) -> Self {
        Self {
            T_co: (&step.camera_from_object).into(),
            covariance: step.covariance.as_ref().map(Matrix::from),
            T_init: (&step.init).into(),
            T_registered: (&step.outcome.camera_from_object).into(),
            termination: step.outcome.termination.name(),
            mve: step.mve,
            event: match &step.event {
                SequentialEvent::Estimated(update) => update.name(),
                SequentialEvent::NoEstimate(_) => "no_estimate",
                SequentialEvent::Refused(_) => "refused",
                _ => "other",
            },
        }
    }
}

#[pymethods]
impl PySequentialStep {
    fn __repr__(&self) -> String {
        let t = self.T_co.translation();
        format!("SequentialStep({}, t = {t} m)", self.event)
    }
}
