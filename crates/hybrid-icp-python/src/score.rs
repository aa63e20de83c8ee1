//! Renders depth images, and computes scores and pose errors.

use hybrid_icp::core::{Isometry3, Problem, RenderedView, Renderer};
use hybrid_icp::icp::Workspace;
use hybrid_icp::raster::Rasterizer;
use hybrid_icp::score::{MaskTrust, MeanVsd, Occlusion, Score, VISIBILITY_TOLERANCE_METERS};
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::array::{self, Matrix};
use crate::errors;
use crate::errors::InputError;
use crate::input::camera::PyCamera;
use crate::input::depth;
use crate::input::model::PyModel;
use crate::input::observation::PyObservation;

/// Renders the depth of a model at a pose.
///
/// Parameters
/// ----------
/// model : Model
/// camera : Camera
/// T_co : array_like, shape (4, 4)
///     Camera from object, meters.
///
/// Returns
/// -------
/// numpy.ndarray, shape (H, W), float32
///     Depth along the optical axis, meters; 0 for pixels that the model does not cover.
#[pyfunction]
#[allow(non_snake_case)]
pub(crate) fn render_depth(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    camera: PyCamera,
    T_co: &Bound<'_, PyAny>,
) -> PyResult<Matrix<f32>> {
    let pose = array::motion(T_co, "T_co")?.isometry;
    let mesh = model.get().model.mesh();
    let image = py.detach(|| hybrid_icp::raster::render_depth_image(mesh, &camera.0, &pose));
    Ok(depth::image(image.width(), image.pixels()))
}

/// Computes the mean VSD estimate (MVE) of a pose, which needs no ground truth.
///
/// It is 0 if the pose explains the image everywhere, and 1 if it explains the image nowhere.
///
/// Parameters
/// ----------
/// model : Model
/// observation : Observation
/// T_co : array_like, shape (4, 4)
///     Camera from object, meters.
/// occlusion_tolerance : float or None, optional
///     Rendered pixels outside the mask do not count if the measured surface hides them by more
///     than this distance, meters, 0.015 if not given. With a negative value, the measured surface
///     can also be that far behind, for masks that miss a part of the object. `None` is the
///     definition of the paper: every rendered pixel counts.
/// imperfect_mask : bool, optional
///     Expects the mask of a detector: too large, too small, soft, or a box. `occlusion_tolerance`
///     then has no effect.
///
/// Returns
/// -------
/// float
///     The mean over τ = 5 %, …, 50 % of the diameter.
#[pyfunction]
#[pyo3(signature = (model, observation, T_co, *, occlusion_tolerance = VISIBILITY_TOLERANCE_METERS, imperfect_mask = false))]
#[allow(non_snake_case)]
pub(crate) fn mve(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    observation: &Bound<'_, PyObservation>,
    T_co: &Bound<'_, PyAny>,
    occlusion_tolerance: Option<f64>,
    imperfect_mask: bool,
) -> PyResult<f64> {
    let pose = array::motion(T_co, "T_co")?.isometry;
    let (model, observation) = (&model.get().model, &observation.get().observation);
    let tolerance = occlusion_tolerance
        .map(|length| tolerance("occlusion_tolerance", length))
        .transpose()?;
    let mut score = MeanVsd {
        occlusion: tolerance.map_or(Occlusion::Counted, Occlusion::from_tolerance),
        mask: match imperfect_mask {
            true => MaskTrust::Imperfect,
            false => MaskTrust::Exact,
        },
    };
    Ok(py.detach(|| {
        let mut workspace = Workspace::new(Rasterizer::default());
        let problem = Problem::new(model, observation);
        score.score(&mut workspace.context(&problem), &pose)
    }))
}

/// Returns a tolerance in meters, or an error if it is probably in millimeters.
fn tolerance(name: &str, meters: f64) -> PyResult<f64> {
    if meters.abs() < 1.0 || !meters.is_finite() {
        return Ok(meters);
    }
    let text = format!("{name} is {meters}, expected meters between -1 and 1, such as 0.015");
    Err(InputError::new_err(text))
}

/// Computes the visible surface discrepancy (VSD) of BOP'19 between an estimated and a true pose.
///
/// Parameters
/// ----------
/// model : Model
/// observation : Observation
///     Only its depth image and camera are used, not its mask.
/// T_est, T_gt : array_like, shape (4, 4)
///     The estimated and the true pose, camera from object, meters.
/// delta : float, optional
///     Visibility tolerance, meters, 0.015 if not given.
///
/// Returns
/// -------
/// numpy.ndarray, shape (10,), float64
///     e_VSD for τ = 5 %, 10 %, …, 50 % of the diameter; 1 if neither render has a visible pixel.
#[pyfunction]
#[pyo3(signature = (model, observation, T_est, T_gt, *, delta = VISIBILITY_TOLERANCE_METERS))]
#[allow(non_snake_case)]
pub(crate) fn vsd<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyModel>,
    observation: &Bound<'py, PyObservation>,
    T_est: &Bound<'py, PyAny>,
    T_gt: &Bound<'py, PyAny>,
    delta: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (estimate, truth) = poses(T_est, T_gt)?;
    let delta = tolerance("delta", delta)?;
    let (model, observation) = (&model.get().model, &observation.get().observation);
    let camera = observation.camera();
    let errors = py.detach(|| {
        let mut renderer = Rasterizer::default();
        let mut render = |pose| {
            let mut view = RenderedView::default();
            renderer.render(model.mesh(), camera, pose, &camera.region(), &mut view);
            view
        };
        let (estimate, truth) = (render(&estimate), render(&truth));
        hybrid_icp::score::bop_vsd(
            observation.depth(),
            camera,
            &estimate,
            &truth,
            model.diameter(),
            delta,
        )
    });
    Ok(PyArray1::from_slice(py, &errors.map_err(errors::input)?))
}

/// Computes ADD, the mean distance between corresponding model points at two poses.
///
/// Parameters
/// ----------
/// T_est, T_gt : array_like, shape (4, 4)
///     The estimated and the true pose, camera from object, meters.
/// model : Model
///     Its vertices are used.
///
/// Returns
/// -------
/// float
///     Meters.
#[pyfunction]
#[allow(non_snake_case)]
pub(crate) fn add(
    T_est: &Bound<'_, PyAny>,
    T_gt: &Bound<'_, PyAny>,
    model: &Bound<'_, PyModel>,
) -> PyResult<f64> {
    let (estimate, truth) = poses(T_est, T_gt)?;
    let points = model.get().points();
    Ok(points.add(&estimate, &truth))
}

/// Computes ADI (ADD-S), the mean distance between closest model points at two poses.
///
/// For each model point at the true pose, it uses the closest model point at the estimate.
///
/// Parameters
/// ----------
/// T_est, T_gt : array_like, shape (4, 4)
///     The estimated and the true pose, camera from object, meters.
/// model : Model
///     Its vertices are used.
///
/// Returns
/// -------
/// float
///     Meters.
#[pyfunction]
#[allow(non_snake_case)]
pub(crate) fn adi(
    py: Python<'_>,
    T_est: &Bound<'_, PyAny>,
    T_gt: &Bound<'_, PyAny>,
    model: &Bound<'_, PyModel>,
) -> PyResult<f64> {
    let (estimate, truth) = poses(T_est, T_gt)?;
    let model = model.get();
    Ok(py.detach(|| model.points().adi(&estimate, &truth)))
}

/// Computes MSSD, the maximum symmetry-aware surface distance of BOP.
///
/// Parameters
/// ----------
/// T_est, T_gt : array_like, shape (4, 4)
///     The estimated and the true pose, camera from object, meters.
/// model : Model
///     Its vertices and declared symmetries are used.
///
/// Returns
/// -------
/// float
///     Meters.
#[pyfunction]
#[allow(non_snake_case)]
pub(crate) fn mssd(
    py: Python<'_>,
    T_est: &Bound<'_, PyAny>,
    T_gt: &Bound<'_, PyAny>,
    model: &Bound<'_, PyModel>,
) -> PyResult<f64> {
    let (estimate, truth) = poses(T_est, T_gt)?;
    let model = model.get();
    Ok(py.detach(|| model.points().mssd(&estimate, &truth)))
}

/// Computes MSPD, the maximum symmetry-aware projection distance of BOP.
///
/// Parameters
/// ----------
/// T_est, T_gt : array_like, shape (4, 4)
///     The estimated and the true pose, camera from object, meters.
/// model : Model
///     Its vertices and declared symmetries are used.
/// camera : Camera
///
/// Returns
/// -------
/// float
///     Pixels; infinite if a point is not in front of the camera.
#[pyfunction]
#[allow(non_snake_case)]
pub(crate) fn mspd(
    py: Python<'_>,
    T_est: &Bound<'_, PyAny>,
    T_gt: &Bound<'_, PyAny>,
    model: &Bound<'_, PyModel>,
    camera: PyCamera,
) -> PyResult<f64> {
    let (estimate, truth) = poses(T_est, T_gt)?;
    let model = model.get();
    Ok(py.detach(|| model.points().mspd(&estimate, &truth, &camera.0)))
}

/// Reads the estimated and the true pose.
#[allow(non_snake_case)]
fn poses(
    T_est: &Bound<'_, PyAny>,
    T_gt: &Bound<'_, PyAny>,
) -> PyResult<(Isometry3<f64>, Isometry3<f64>)> {
    let (estimate, truth) = (array::motion(T_est, "T_est")?, array::motion(T_gt, "T_gt")?);
    Ok((estimate.isometry, truth.isometry))
}
