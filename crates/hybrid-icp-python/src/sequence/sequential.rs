//! Registers and fuses images while the camera moves.

use std::sync::Mutex;

use hybrid_icp::fusion::{FusionMethod, Update};
use hybrid_icp::{Calibration, MotionCheck, SequentialEstimator, SequentialEvent};
use pyo3::prelude::*;

use crate::array::{self, Matrix, Motion};
use crate::errors::{self, InputError};
use crate::input::model::PyModel;
use crate::input::observation::PyObservation;
use crate::mutex::locked;
use crate::pipeline::PyPipeline;
use crate::results;
use crate::sequence::fusion::{self, PyPoseEstimate};

/// Estimates the pose of a static object from the images of a moving camera (§V of the paper).
///
/// Each image is registered from the fused pose, moved with the camera. The registered pose is then
/// fused, and the next image starts from the result. While all images have failed a limit
/// ("provisional"), the next one is also registered from the initial pose.
///
/// Parameters
/// ----------
/// pipeline : Pipeline
///     The pipeline that registers each image.
/// method : str
///     The fusion method, one of `Fuser.methods()`.
/// model : Model
/// T_co : array_like, shape (4, 4)
///     The initial pose in the first camera frame, camera from object, meters.
/// paper : bool, optional
///     If true, follows §V exactly: no gate, and covariances e_MVE·I₆ that do not move with the
///     camera. Otherwise uncertainty refers to the center of the object, estimates with an MVE
///     above 0.4 are rejected, and symmetric poses are fused as one.
/// covariance : {"mve", "calibrated"}, optional
///     Covariance of the estimates. "calibrated" is the default, unless `paper` is true, which
///     requires "mve". It is about as wide as the errors: the covariance of the registration, with
///     factors that were fitted to "hybrid" and to models reconstructed from images. It also
///     rejects estimates with an MVE above 0.25, and those whose squared Mahalanobis distance from
///     the fused pose is above 100. The distance allows for a camera that is off by 1 mm and 0.11°
///     along and around each axis. After three such estimates that agree with each other, it starts
///     again from the last. "mve" is a weight: the MVE in units of the object. It is not
///     calibrated, so do not use it as an error.
///     `bop sequence` names them `--uncertainty registration` and `--uncertainty mve`.
#[pyclass(frozen, module = "hybrid_icp", name = "SequentialEstimator")]
pub(crate) struct PySequentialEstimator {
    estimator: Mutex<SequentialEstimator>,
    check: Mutex<MotionCheck>,
    pipeline: Py<PyPipeline>,
    method: FusionMethod,
    model: Py<PyModel>,
}

#[pymethods]
#[allow(non_snake_case)]
impl PySequentialEstimator {
    #[new]
    #[pyo3(signature = (pipeline, method, model, T_co, *, paper = false, covariance = None))]
    fn new(
        pipeline: &Bound<'_, PyPipeline>,
        method: &str,
        model: &Bound<'_, PyModel>,
        T_co: &Bound<'_, PyAny>,
        paper: bool,
        covariance: Option<&str>,
    ) -> PyResult<Self> {
        let method: FusionMethod = method.parse().map_err(errors::input)?;
        let init = array::motion(T_co, "T_co")?.isometry;
        let choices = [("mve", false), ("calibrated", true)];
        let covariance = covariance.map(|name| array::choice("covariance", name, choices));
        let calibrated = covariance.transpose()?.unwrap_or(!paper);
        let stage = pipeline.get().build()?;
        let object = &model.get().model;
        let estimator = match (paper, calibrated) {
            (false, false) => SequentialEstimator::for_object(stage, method, object, &init),
            (false, true) => {
                let preset = pipeline.get().name().parse();
                let calibration = preset.map_or(Calibration::HYBRID, Calibration::of);
                SequentialEstimator::calibrated(stage, method, &calibration, object, &init)
            }
            (true, false) => SequentialEstimator::paper(stage, method, &init),
            (true, true) => {
                let text = "paper is True with covariance=\"calibrated\", expected one of them";
                return Err(InputError::new_err(text));
            }
        };
        Ok(Self {
            estimator: Mutex::new(estimator.map_err(errors::input)?),
            check: Mutex::default(),
            pipeline: pipeline.clone().unbind(),
            method,
            model: model.clone().unbind(),
        })
    }

    /// Registers and fuses an image, after a motion of the camera since the previous image.
    ///
    /// Parameters
    /// ----------
    /// observation : Observation
    /// T_nc : array_like, shape (4, 4), optional
    ///     Camera of this image from the camera of the previous image, meters. By default, the
    ///     camera did not move.
    /// covariance : array_like, shape (6, 6), optional
    ///     Covariance of the motion, as a left perturbation in the camera frame of this image.
    ///
    /// Returns
    /// -------
    /// SequentialStep
    ///
    /// Warns
    /// -----
    /// InputWarning
    ///     As for `Pipeline.refine`, while there is no estimate. If the images contradict `T_nc`:
    ///     the event is "restarted", or two or more images, and as many as were accepted, do not
    ///     show the object at the pose that moved with the camera. If a filter makes this warning
    ///     an error, the step has been taken: `T_co` has its pose.
    #[pyo3(signature = (observation, T_nc = None, covariance = None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        observation: &Bound<'_, PyObservation>,
        T_nc: Option<&Bound<'_, PyAny>>,
        covariance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let motion = fusion::motion(T_nc, covariance)?;
        let (model, observation) = (self.model.get(), observation.get());
        let first = py.detach(|| {
            let estimator = locked(&self.estimator);
            let init = estimator.camera_from_object();
            estimator.estimate().is_none().then_some(init)
        });
        if let Some(init) = first {
            let init = Motion::new(motion.apply(&init));
            let pipeline = self.pipeline.get();
            pipeline.warn_of(py, model, observation, &init)?;
        }
        let (model, observation) = (&model.model, &observation.observation);
        // Release the GIL first: another thread may hold the lock for a whole step.
        let step = py.detach(|| locked(&self.estimator).step(model, observation, &motion));
        let mut check = locked(&self.check);
        let before = *check;
        match step.event {
            SequentialEvent::NoEstimate(_) if observation.n_measured() > 0 => check.miss(),
            _ => check.add(&step.event),
        }
        let after = *check;
        drop(check);
        // The object may be hidden in one image.
        let is_contradicted = |check: MotionCheck| check.contradicting().is_some_and(|n| n > 1);
        let restarted = matches!(
            step.event,
            SequentialEvent::Estimated(Update::Restarted(..))
        );
        if restarted || (is_contradicted(after) && !is_contradicted(before)) {
            let start = if restarted {
                "the fuser started again, because the last images"
            } else {
                "as many images as were accepted, or more,"
            };
            let text = format!(
                "{start} contradict the pose that moved with the camera: check that T_nc is \
                 the next camera from the camera, in meters, and that the object stands still"
            );
            errors::warn(py, &text)?;
        }
        results::sequential_step(py, &step)
    }

    /// Moves the camera without an image.
    ///
    /// Parameters
    /// ----------
    /// T_nc : array_like, shape (4, 4)
    ///     Next camera from camera, meters.
    /// covariance : array_like, shape (6, 6), optional
    ///     Covariance of the motion.
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

    /// Removes all estimates and starts again from a pose in the current camera frame.
    ///
    /// Parameters
    /// ----------
    /// T_co : array_like, shape (4, 4)
    ///     Camera from object, meters.
    fn restart(&self, py: Python<'_>, T_co: &Bound<'_, PyAny>) -> PyResult<()> {
        let init = array::motion(T_co, "T_co")?.isometry;
        py.detach(|| locked(&self.estimator).restart(&init))
            .map_err(errors::input)?;
        *locked(&self.check) = MotionCheck::default();
        Ok(())
    }

    /// The fused pose in the current camera frame, shape (4, 4), float64, meters; the initial pose
    /// while there is no estimate.
    #[getter]
    fn T_co(&self, py: Python<'_>) -> Matrix {
        (&py.detach(|| locked(&self.estimator).camera_from_object())).into()
    }

    /// The fused estimate in the current camera frame; None before the first estimate.
    #[getter]
    fn estimate(&self, py: Python<'_>) -> Option<PyPoseEstimate> {
        py.detach(|| locked(&self.estimator).estimate())
            .map(PyPoseEstimate)
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let (method, place) = (self.method, self.T_co(py).translation());
        let state = match self.estimate(py) {
            Some(_) => "estimated",
            None => "no estimate",
        };
        format!("SequentialEstimator('{method}', {state}, t = {place} m)")
    }
}
