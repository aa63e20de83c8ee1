//! `Observation`.

use std::sync::Arc;

use hybrid_icp::core::{DepthImage, Mask, NormalWindow, Observation, PinholeCamera};
use numpy::PyArray3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{self, Matrix};
use crate::errors::{self, InputError};
use crate::input::camera::PyCamera;
use crate::input::color;
use crate::input::depth::{self, PyDepthImage};
use crate::input::model::PyModel;

/// The positional and the named arguments that create an observation again.
type Arguments<'py> = (
    (Py<PyDepthImage>, Matrix<bool>, PyCamera),
    Bound<'py, PyDict>,
);

/// Checks that a depth image has the size of its camera.
fn check_size(
    camera: &PinholeCamera,
    depth: &Bound<'_, PyAny>,
    image: &DepthImage,
) -> PyResult<()> {
    if camera.size() == image.size() {
        return Ok(());
    }
    let turned = (image.height(), image.width());
    let hint = match camera.size() == turned {
        true => "; the size of a camera is (width, height)",
        false => "",
    };
    Err(InputError::new_err(format!(
        "camera is for {}x{} images but depth is {} with shape ({}, {}), expected shape ({}, {}){hint}",
        camera.width(),
        camera.height(),
        array::kind(depth),
        image.height(),
        image.width(),
        camera.height(),
        camera.width()
    )))
}

/// Returns the mask of a box, for a detector without a segmentation.
///
/// The presets `local`, `search`, `auto` and `color`, and `estimate`, give no weight to a table in
/// the box. `hybrid`, `hybrid-visible` and the baselines treat it as part of the object.
///
/// Parameters
/// ----------
/// bbox : array_like, shape (4,)
///     x and y of the left upper corner, width and height, pixels. A box of two corners
///     (x1, y1, x2, y2) is (x1, y1, x2 - x1, y2 - y1).
/// camera : Camera
///     The camera of the image, which has its size.
///
/// Returns
/// -------
/// numpy.ndarray, shape (H, W), bool
///     The mask, for `Observation`.
///
/// Raises
/// ------
/// InputError
///     If `bbox` does not have four numbers, or the box has no pixel in the image.
///
/// Warns
/// -----
/// InputWarning
///     If `bbox` looks like two corners, or like fractions of the image.
///
/// Examples
/// --------
/// >>> from hybrid_icp import Camera, mask_in_box
/// >>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
/// >>> int(mask_in_box((20, 20, 25, 30), camera).sum())
/// 750
#[pyfunction]
pub(crate) fn mask_in_box(
    py: Python<'_>,
    bbox: &Bound<'_, PyAny>,
    camera: PyCamera,
) -> PyResult<Matrix<bool>> {
    let expected = "four numbers: x, y, width and height of a box in the image, pixels";
    let bbox = array::numbers::<f64>(bbox, &[Some(4)], "bbox", expected)?.0;
    let bbox @ [x, y, w, h] = [bbox[0], bbox[1], bbox[2], bbox[3]];
    let (width, height) = camera.0.size();
    if !hybrid_icp::checks::box_overlaps(bbox, (width, height)) {
        let found = format!("bbox is ({x}, {y}, {w}, {h}) in a {width}x{height} image");
        return Err(InputError::new_err(format!("{found}, expected {expected}")));
    }
    if let Some(warning) = hybrid_icp::checks::warning_of_box(bbox, (width, height)) {
        errors::warn(py, &format!("bbox ({x}, {y}, {w}, {h}): {warning}"))?;
    }
    let mask = Mask::in_box(width, height, bbox);
    Ok(depth::image(width, mask.pixels()))
}

/// A segmented depth image, for refining poses.
///
/// It is immutable, and hypotheses and threads can share it. Each array is copied once, so later
/// changes of the arrays have no effect. For several objects in one image, create one `DepthImage`
/// and an observation per mask.
///
/// Parameters
/// ----------
/// depth : DepthImage or numpy.ndarray, shape (H, W) or (H, W, 1)
///     Depth along the optical axis: float32 (or float16 or float64) meters, or integers of 16 or
///     more bits with `scale`. Pixels without a measurement are 0, negative, infinite or NaN, or
///     65535 in uint16. A `DepthImage` is shared, not copied.
/// mask : numpy.ndarray of bool or uint8, shape (H, W) or (H, W, 1), or None
///     Nonzero on the object. `None` selects every pixel. Other integers must be 0 and 1, or 0 and
///     255.
/// camera : Camera
///     A camera for images of this size.
/// scale : float, optional
///     Meters per unit of an image of integers, such as 0.001; BOP's `depth_scale` divided by 1000.
/// color : numpy.ndarray of uint8, shape (H, W, 3), optional
///     Red, green and blue of the same pixels. It decides where depth alone is ambiguous, with a
///     model that has colors (`Model.has_color`). Only `Pipeline("color")`, custom pipelines with
///     parts that compare colors, and `estimate` use it.
/// normal_window : int, optional
///     Half side of the window that normals are fitted over, from 1 (3 × 3 pixels) to 10. By
///     default, it follows the noise of the image.
///
/// Raises
/// ------
/// InputError
///     If a shape, dtype or unit is wrong. The message has the value found and the one expected.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from hybrid_icp import Camera, Observation
/// >>> camera = Camera(100, 100, 31.5, 23.5, 64, 48)
/// >>> wall = np.full((48, 64), 0.8, np.float32)
/// >>> Observation(wall, None, camera).n_measured
/// 3072
/// >>> Observation(wall * 1000, None, camera)
/// Traceback (most recent call last):
/// ...
/// hybrid_icp.InputError: depth looks like millimeters: median 800, expected meters (divide by
/// 1000, or pass uint16 with scale=0.001)
#[pyclass(frozen, module = "hybrid_icp", name = "Observation")]
#[derive(Debug)]
pub(crate) struct PyObservation {
    pub(crate) observation: Observation,
    /// The depth image of the observation, one object, so that pickling writes it once.
    image: Py<PyDepthImage>,
}

#[pymethods]
impl PyObservation {
    #[new]
    #[pyo3(signature = (depth, mask, camera, *, scale = None, color = None, normal_window = None))]
    fn new(
        py: Python<'_>,
        depth: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
        camera: PyCamera,
        scale: Option<f64>,
        color: Option<&Bound<'_, PyAny>>,
        normal_window: Option<u8>,
    ) -> PyResult<Self> {
        let image = depth::shared(depth, scale)?;
        let pixels = Arc::clone(&image.get().0);
        let mask = depth::mask(mask, &pixels)?;
        let camera = camera.0;
        check_size(&camera, depth, &pixels)?;
        let color = color.map(|value| color::image(value, "color", Some(pixels.size())));
        let color = color.transpose()?;
        let window = normal_window.map_or(NormalWindow::Automatic, NormalWindow::HalfSide);
        let observation = py.detach(|| {
            let observation = Observation::with_normal_window(pixels, mask, camera, window)?;
            match color {
                Some(color) => observation.with_color(color),
                None => Ok(observation),
            }
        });
        Ok(Self {
            observation: observation.map_err(errors::input)?,
            image: image.unbind(),
        })
    }

    /// The camera.
    #[getter]
    fn camera(&self) -> PyCamera {
        PyCamera(*self.observation.camera())
    }

    /// A copy of the depth image, shape (H, W), float32, meters; 0 for pixels without a
    /// measurement.
    #[getter]
    fn depth(&self) -> Matrix<f32> {
        self.image.get().to_numpy()
    }

    /// The depth image as a `DepthImage`, (H, W) meters, for observations with other masks.
    ///
    /// It is shared and not copied.
    #[getter]
    fn image(&self, py: Python<'_>) -> Py<PyDepthImage> {
        self.image.clone_ref(py)
    }

    /// A copy of the mask, shape (H, W), bool.
    #[getter]
    fn mask(&self) -> Matrix<bool> {
        let mask = self.observation.mask();
        depth::image(mask.width(), mask.pixels())
    }

    /// A copy of the colors of the pixels, shape (H, W, 3), uint8, or None if there are none.
    #[getter]
    fn color<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<u8>>>> {
        let image = self.observation.color();
        image.map(|image| color::to_numpy(py, image)).transpose()
    }

    /// Number of masked pixels with a depth.
    #[getter]
    fn n_measured(&self) -> usize {
        self.observation.n_measured()
    }

    /// Number of masked pixels with a surfel (a point with a normal).
    #[getter]
    fn n_surfels(&self) -> usize {
        self.observation.n_surfels()
    }

    /// Returns the points and normals of the masked surface, in the camera frame.
    ///
    /// Returns
    /// -------
    /// points : numpy.ndarray, shape (n_surfels, 3), float32
    ///     Meters.
    /// normals : numpy.ndarray, shape (n_surfels, 3), float32
    ///     Unit length, toward the camera.
    fn surfels(&self, py: Python<'_>) -> (Matrix<f32>, Matrix<f32>) {
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        py.detach(|| {
            for (_, surfel) in self.observation.surfels(1) {
                points.extend_from_slice(surfel.point.coords.as_slice());
                normals.extend_from_slice(surfel.normal.as_slice());
            }
        });
        (Matrix::new(3, points), Matrix::new(3, normals))
    }

    /// Returns the measured minus the rendered depth at the pose of a result.
    ///
    /// Parameters
    /// ----------
    /// result : Result
    /// model : Model, optional
    ///     By default, the model that was refined.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray, shape (H, W), float32
    ///     Meters; NaN where nothing was measured or rendered.
    #[pyo3(signature = (result, *, model = None))]
    fn residuals<'py>(
        slf: &Bound<'py, Self>,
        result: &Bound<'py, PyAny>,
        model: Option<&Bound<'py, PyModel>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let module = slf.py().import("hybrid_icp._pictures")?;
        module.call_method1("residuals", (slf, result, model))
    }

    /// Creates an observation from a depth image and an intrinsic calibration of Open3D.
    ///
    /// Parameters
    /// ----------
    /// depth : open3d.geometry.Image or open3d.geometry.RGBDImage
    ///     Depth in integers of `scale` meters, or in floats of meters. The color of an `RGBDImage`
    ///     is used if it has three channels.
    /// intrinsic : open3d.camera.PinholeCameraIntrinsic
    /// mask : array_like, shape (H, W), bool or uint8, optional
    ///     Nonzero on the object. By default, every pixel.
    /// scale : float, optional
    ///     Meters per unit of integers: one divided by the `depth_scale` of Open3D.
    /// color : open3d.geometry.Image or array_like, shape (H, W, 3), uint8, optional
    ///     The color image of the same pixels.
    ///
    /// Returns
    /// -------
    /// Observation
    #[staticmethod]
    #[pyo3(signature = (depth, intrinsic, mask = None, *, scale = 0.001, color = None))]
    fn from_open3d<'py>(
        py: Python<'py>,
        depth: &Bound<'py, PyAny>,
        intrinsic: &Bound<'py, PyAny>,
        mask: Option<&Bound<'py, PyAny>>,
        scale: f64,
        color: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        if scale > 1.0 {
            let text = format!(
                "scale is {scale}, expected meters per unit, such as 0.001: the depth_scale of \
                 Open3D is units per meter, so pass 1 / depth_scale"
            );
            return Err(InputError::new_err(text));
        }
        let numpy = py.import("numpy")?;
        let array = |value: &Bound<'py, PyAny>| numpy.call_method1("asarray", (value,));
        let (depth, of_pair) = match depth.getattr_opt("depth")? {
            Some(of_pair) => (array(&of_pair)?, Some(array(&depth.getattr("color")?)?)),
            None => (array(depth)?, None),
        };
        let is_color = |color: &Bound<'_, PyAny>| {
            let shape = color.getattr("shape")?.extract::<Vec<usize>>();
            shape.map(|shape| matches!(shape[..], [_, _, 3]))
        };
        let color = match (color, of_pair) {
            (Some(color), _) => Some(array(color)?),
            (None, Some(color)) if is_color(&color)? => Some(color),
            _ => None,
        };
        let kind: String = depth.getattr("dtype")?.getattr("kind")?.extract()?;
        let size = (intrinsic.getattr("width")?, intrinsic.getattr("height")?);
        let calibration = intrinsic.getattr("intrinsic_matrix")?;
        let camera = py
            .get_type::<PyCamera>()
            .call_method1("from_K", (calibration, size))?;
        let scale = (kind != "f").then_some(scale);
        let (camera, color) = (camera.extract()?, color.as_ref());
        Self::new(py, &depth, mask, camera, scale, color, None)
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<Arguments<'py>> {
        let options = PyDict::new(py);
        options.set_item("color", self.color(py)?)?;
        if let NormalWindow::HalfSide(pixels) = self.observation.normal_window() {
            options.set_item("normal_window", pixels)?;
        }
        Ok(((self.image(py), self.mask(), self.camera()), options))
    }

    fn _repr_png_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let module = slf.py().import("hybrid_icp._pictures")?;
        module.call_method1("of_observation", (slf,))
    }

    fn __repr__(&self) -> String {
        let camera = self.observation.camera();
        format!(
            "Observation({}x{}, {} masked pixels with depth, {} with a normal)",
            camera.width(),
            camera.height(),
            self.n_measured(),
            self.n_surfels()
        )
    }
}
