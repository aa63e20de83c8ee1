//! Fuses pose estimates.

use std::sync::Mutex;

use hybrid_icp::Calibration;
use hybrid_icp::fusion::{
    BoxedFuser, CameraMotion, Fuser as _, FuserConfig, FusionLimits, FusionMethod, Gate, Gated,
    PoseEstimate, SymmetryAware, Transport, UnitCovariance,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{self, Matrix};
use crate::errors;
use crate::input::model::PyModel;
use crate::mutex::locked;

/// An estimate of the pose of an object, with its covariance and, if known, its MVE.
///
/// Parameters
/// ----------
/// T_co : array_like, shape (4, 4)
///     Camera from object, meters.
/// covariance : array_like, shape (6, 6)
///     Covariance of ξ = [ρ; φ], a left perturbation in the camera frame, translation first
///     (meters, radians). It may be singular.
/// mve : float, optional
///     Mean VSD estimate, 0 to 1.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from hybrid_icp import PoseEstimate
/// >>> PoseEstimate(np.eye(4), np.eye(6) * 1e-4, mve=0.1).mve
/// 0.1
#[pyclass(frozen, module = "hybrid_icp", name = "PoseEstimate", from_py_object)]
#[derive(Clone, Copy, Debug)]
pub(crate) struct PyPoseEstimate(pub(crate) PoseEstimate);

#[pymethods]
#[allow(non_snake_case)]
impl PyPoseEstimate {
    #[new]
    #[pyo3(signature = (T_co, covariance, *, mve = None))]
    fn new(
        T_co: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
        mve: Option<f64>,
    ) -> PyResult<Self> {
        let motion = array::motion(T_co, "T_co")?.isometry;
        let covariance = array::matrix6(covariance, "covariance")?;
        let estimate = PoseEstimate::new(motion, covariance).map_err(errors::input)?;
        let estimate = match mve {
            Some(mve) => estimate.with_mve(mve).map_err(errors::input)?,
            None => estimate,
        };
        Ok(Self(estimate))
    }

    /// Creates the estimate of a refined pose, with a covariance about as wide as the error.
    ///
    /// The covariance of a result accounts for the noise of its pixels alone. This one has the
    /// factors of `SequentialEstimator(…, covariance="calibrated")`, and a wrong pose with a high
    /// MVE gets little weight. If `result.covariance` is None, as of a can, it is that of a nearly
    /// unknown pose (0.3 radii, 0.3 rad): use `SequentialEstimator` there. It leaves out the
    /// error of the mesh, which fusion does not average out.
    ///
    /// Parameters
    /// ----------
    /// result : Result
    /// model : Model
    ///
    /// Returns
    /// -------
    /// PoseEstimate
    #[staticmethod]
    fn from_result(result: &Bound<'_, PyAny>, model: &Bound<'_, PyModel>) -> PyResult<Self> {
        let model = &model.get().model;
        let motion = array::motion(&result.getattr("T_co")?, "result.T_co")?.isometry;
        let mve: f64 = result.getattr("mve")?.extract()?;
        let known: Option<Bound<'_, PyAny>> = result.getattr("covariance")?.extract()?;
        let known = known.map(|known| array::matrix6(&known, "result.covariance"));
        let unit = UnitCovariance::about_object(model.center(), model.radius());
        let model = Calibration::HYBRID.covariance(unit.map_err(errors::input)?);
        let covariance = model.covariance(&motion, Some(mve), known.transpose()?.as_ref());
        let estimate = PoseEstimate::new(motion, covariance);
        let estimate = estimate.and_then(|estimate| estimate.with_mve(mve));
        estimate.map(Self).map_err(errors::input)
    }

    /// The pose, camera from object, shape (4, 4), float64, meters.
    #[getter]
    fn T_co(&self) -> Matrix {
        self.0.camera_from_object().into()
    }

    /// The covariance of ξ = [ρ; φ], shape (6, 6), float64, m², m·rad and rad².
    #[getter]
    fn covariance(&self) -> Matrix {
        self.0.covariance().into()
    }

    /// The mean VSD estimate, if known.
    #[getter]
    fn mve(&self) -> Option<f64> {
        self.0.mve()
    }

    /// Returns the squared Mahalanobis distance of two independent estimates of one pose.
    ///
    /// It follows χ² with 6 degrees of freedom if both covariances are right and small.
    ///
    /// Parameters
    /// ----------
    /// other : PoseEstimate
    ///
    /// Returns
    /// -------
    /// float
    fn mahalanobis_squared(&self, other: &Self) -> f64 {
        self.0.mahalanobis_squared(&other.0)
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<((Matrix, Matrix), Bound<'py, PyDict>)> {
        let options = PyDict::new(py);
        options.set_item("mve", self.mve())?;
        Ok(((self.T_co(), self.covariance()), options))
    }

    fn __repr__(&self) -> String {
        format!("PoseEstimate(t = {} m)", self.T_co().translation())
    }
}

/// Fuses estimates of one pose, in one camera frame (Barfoot & Furgale 2014).
///
/// Parameters
/// ----------
/// estimates : sequence of PoseEstimate
///     One or more.
///
/// Returns
/// -------
/// PoseEstimate
///
/// Examples
/// --------
/// Two estimates differ by 2 mm, and the second has twice the standard deviation:
///
/// >>> import numpy as np
/// >>> from hybrid_icp import PoseEstimate, fuse
/// >>> other = np.eye(4); other[2, 3] = 0.002
/// >>> first = PoseEstimate(np.eye(4), np.eye(6) * 1e-6)
/// >>> fused = fuse([first, PoseEstimate(other, np.eye(6) * 4e-6)])
/// >>> round(float(fused.T_co[2, 3]), 9)
/// 0.0004
#[pyfunction]
pub(crate) fn fuse(estimates: Vec<PyPoseEstimate>) -> PyResult<PyPoseEstimate> {
    let estimates: Vec<PoseEstimate> = estimates.iter().map(|estimate| estimate.0).collect();
    hybrid_icp::fusion::fuse(&estimates, FusionLimits::default())
        .map(|fused| PyPoseEstimate(fused.estimate))
        .map_err(errors::input)
}

/// Fuses pose estimates while the camera moves (§V of the paper).
///
/// The fused estimate is in the current camera frame.
///
/// Parameters
/// ----------
/// method : str
///     One of `Fuser.methods()`.
/// model : Model, optional
///     With a model, one unit of uncertainty is the radius of the object and 1 rad around its
///     center, and symmetric poses are fused as one. Without, it is 1 m and 1 rad around the
///     camera.
/// max_mve, max_mahalanobis_squared : float, optional
///     The gate. Estimates above one of these limits are rejected.
/// restart_after : int, optional
///     Number of consecutive estimates above `max_mahalanobis_squared` that agree with each other,
///     after which the fuser starts again. Without that limit, it has no effect.
/// window : int, optional
///     Maximum number of estimates that "average" and "weighted-average" keep, the newest ones.
/// transport : {"adjoint", "kept"}, optional
///     "adjoint" transforms covariances with the camera motion, "kept" does not.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from hybrid_icp import Fuser, PoseEstimate
/// >>> fuser = Fuser("average")
/// >>> fuser.update(PoseEstimate(np.eye(4), np.eye(6) * 1e-4))
/// 'accepted'
/// >>> advance = np.eye(4); advance[2, 3] = -0.1
/// >>> fuser.propagate(advance)
/// >>> float(fuser.estimate.T_co[2, 3])
/// -0.1
#[pyclass(frozen, module = "hybrid_icp", name = "Fuser")]
pub(crate) struct PyFuser {
    method: FusionMethod,
    fuser: Mutex<BoxedFuser>,
}

#[pymethods]
#[allow(non_snake_case)]
impl PyFuser {
    #[new]
    #[pyo3(signature = (method, *, model = None, max_mve = None, max_mahalanobis_squared = None, restart_after = None, window = None, transport = "adjoint"))]
    fn new(
        method: &str,
        model: Option<&Bound<'_, PyModel>>,
        max_mve: Option<f64>,
        max_mahalanobis_squared: Option<f64>,
        restart_after: Option<usize>,
        window: Option<usize>,
        transport: &str,
    ) -> PyResult<Self> {
        let method: FusionMethod = method.parse().map_err(errors::input)?;
        let model = model.map(|model| &model.get().model);
        let config = FuserConfig {
            transport: array::choice(
                "transport",
                transport,
                [("adjoint", Transport::Adjoint), ("kept", Transport::Kept)],
            )?,
            unit: match model {
                Some(model) => UnitCovariance::about_object(model.center(), model.radius())
                    .map_err(errors::input)?,
                None => UnitCovariance::Identity,
            },
            window,
            ..FuserConfig::default()
        };
        let gate = Gate {
            max_mve,
            max_mahalanobis_squared,
            restart_after,
            ..Gate::default()
        };
        let mut fuser = method.build(config);
        if max_mve.is_some() || max_mahalanobis_squared.is_some() {
            fuser = Box::new(Gated::new(fuser, gate).map_err(errors::input)?);
        }
        if let Some(model) = model {
            let symmetries = model.symmetries().clone();
            let aware = SymmetryAware::new(fuser, symmetries, model.center(), model.radius());
            fuser = Box::new(aware.map_err(errors::input)?);
        }
        Ok(Self {
            method,
            fuser: Mutex::new(fuser),
        })
    }

    /// Returns the names of the methods, in the order of the paper.
    ///
    /// Returns
    /// -------
    /// list of str
    #[staticmethod]
    fn methods() -> Vec<&'static str> {
        FusionMethod::ALL.map(FusionMethod::name).to_vec()
    }

    /// Moves the fused estimate to the next camera frame.
    ///
    /// Parameters
    /// ----------
    /// T_nc : array_like, shape (4, 4)
    ///     Next camera from camera, meters.
    /// covariance : array_like, shape (6, 6), optional
    ///     Covariance of the motion, as a left perturbation in the next camera frame. By default,
    ///     the motion is exact.
    #[pyo3(signature = (T_nc, covariance = None))]
    fn propagate(
        &self,
        T_nc: &Bound<'_, PyAny>,
        covariance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        locked(&self.fuser).propagate(&motion(Some(T_nc), covariance)?);
        Ok(())
    }

    /// Adds an estimate in the current camera frame.
    ///
    /// Parameters
    /// ----------
    /// estimate : PoseEstimate
    ///
    /// Returns
    /// -------
    /// str
    ///     "accepted", "rejected" or "restarted"; "provisional" if it failed the gate but there is
    ///     no other estimate.
    fn update(&self, estimate: &PyPoseEstimate) -> &'static str {
        locked(&self.fuser).update(&estimate.0).name()
    }

    /// The fused estimate in the current camera frame; None before the first estimate.
    #[getter]
    fn estimate(&self) -> Option<PyPoseEstimate> {
        locked(&self.fuser).estimate().map(PyPoseEstimate)
    }

    /// Removes all estimates.
    fn reset(&self) {
        locked(&self.fuser).reset();
    }

    fn __repr__(&self) -> String {
        format!("Fuser('{}')", self.method)
    }
}

/// Motion between two images above which a translation may be in millimeters.
const FARTHEST_STEP_METERS: f64 = 2.0;

/// Reads a motion of the camera. `None` is a camera that does not move.
#[allow(non_snake_case)]
pub(crate) fn motion(
    T_nc: Option<&Bound<'_, PyAny>>,
    covariance: Option<&Bound<'_, PyAny>>,
) -> PyResult<CameraMotion> {
    let motion = match T_nc {
        Some(value) => {
            let motion = array::motion(value, "T_nc")?.isometry;
            let meters = motion.translation.vector.norm();
            if meters > FARTHEST_STEP_METERS {
                let moved = format!("T_nc moves the camera by {meters:.1} m between two images");
                errors::warn(value.py(), &format!("{moved}: check that it is in meters"))?;
            }
            CameraMotion::new(motion)
        }
        None => Ok(CameraMotion::none()),
    };
    let motion = motion.map_err(errors::input)?;
    match covariance {
        Some(value) => motion
            .with_covariance(&array::matrix6(value, "covariance")?)
            .map_err(errors::input),
        None => Ok(motion),
    }
}
