//! Reads `DepthImage`s and masks from NumPy arrays.

use std::path::PathBuf;
use std::sync::Arc;

use hybrid_icp::core::{DepthImage, Isometry3, Mask, internal};
use numpy::ndarray::ArrayView2;
use numpy::{
    AllowTypeChange, PyArrayDescrMethods, PyArrayLike2, PyReadonlyArray2, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::array::{self, Matrix, unexpected};
use crate::errors::{self, InputError};
use crate::input::camera::PyCamera;

const EXPECTED_DEPTH: &str = "an (H, W) array of float32 meters, or of uint16 or int32 together with scale= (meters per unit)";

/// The largest median depth accepted, meters. Larger values are probably millimeters: no camera
/// measures below 100 mm or beyond 100 m.
const MAX_MEDIAN_METERS: f32 = 100.0;

/// The smallest median depth accepted, meters. Smaller values were probably scaled twice.
const MIN_MEDIAN_METERS: f32 = 0.01;

/// The advice for arrays of millimeters.
const ADVICE: &str = "divide by 1000, or pass uint16 with scale=0.001";

/// Rows and columns of the pixel grid that the check of the unit reads first.
const GRID: usize = 64;

/// A depth image that the observations of several masks share.
///
/// The array is read, checked and copied once. The copy is necessary: other threads can write to
/// the array while the GIL is released.
///
/// Parameters
/// ----------
/// depth : numpy.ndarray, shape (H, W) or (H, W, 1)
///     Depth along the optical axis: float32 (or float16 or float64) meters, or integers of 16 or
///     more bits with `scale`. Pixels without a measurement are 0, negative, infinite or NaN, or
///     65535 in uint16.
/// scale : float, optional
///     Meters per unit of an image of integers, such as 0.001; BOP's `depth_scale` divided by 1000.
///
/// Raises
/// ------
/// InputError
///     If the shape, dtype or unit is wrong. The message has the value found and the one expected.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from hybrid_icp import Camera, DepthImage, Observation
/// >>> camera = Camera(100, 100, 31.5, 23.5, 64, 48)
/// >>> image = DepthImage(np.full((48, 64), 800, np.uint16), scale=0.001)  # Once per image.
/// >>> image
/// DepthImage(64x48)
/// >>> masks = np.zeros((2, 48, 64), bool)
/// >>> masks[0, :, :32] = masks[1, :, 32:] = True
/// >>> [Observation(image, mask, camera).n_measured for mask in masks]
/// [1536, 1536]
#[pyclass(frozen, eq, module = "hybrid_icp", name = "DepthImage")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PyDepthImage(pub(crate) Arc<DepthImage>);

#[pymethods]
impl PyDepthImage {
    #[new]
    #[pyo3(signature = (depth, *, scale = None))]
    fn new(depth: &Bound<'_, PyAny>, scale: Option<f64>) -> PyResult<Self> {
        read(depth, scale).map(|image| Self(Arc::new(image)))
    }

    /// Reads a 16-bit gray PNG without an intermediate array.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    /// scale : float
    ///     Meters per unit, such as 0.001; BOP's `depth_scale` divided by 1000.
    ///
    /// Returns
    /// -------
    /// DepthImage
    ///
    /// Raises
    /// ------
    /// FileError
    ///     If the file cannot be read or is not such an image.
    /// InputError
    ///     If `scale` is wrong, or if the depths at this scale cannot be meters.
    #[staticmethod]
    pub(crate) fn from_png(py: Python<'_>, path: PathBuf, scale: f64) -> PyResult<Self> {
        let millimeters = millimeters(scale)?;
        let image = py.detach(|| hicp_io::read_depth_png(&path, millimeters));
        let image = image.map_err(errors::file)?;
        check(&image, &advice_on(scale))?;
        Ok(Self(Arc::new(image)))
    }

    /// Projects the points of a depth sensor into a camera.
    ///
    /// A pixel has the depth of its nearest point, and is missing without points.
    /// `Observation(image, image.to_numpy() > 0, camera)` is the observation of a cloud that shows
    /// the object alone.
    ///
    /// Parameters
    /// ----------
    /// points : array_like, shape (N, 3), float32
    ///     Points, meters. Those that are not finite or not in the image are skipped.
    /// camera : Camera
    /// T_cp : array_like, shape (4, 4), optional
    ///     The pose of the points' frame, camera from points, meters. The default is the identity.
    ///
    /// Returns
    /// -------
    /// DepthImage
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If the depths cannot be meters, such as those of points in millimeters.
    ///
    /// Warns
    /// -----
    /// InputWarning
    ///     If no point is in the image.
    #[staticmethod]
    #[pyo3(signature = (points, camera, T_cp = None))]
    #[allow(non_snake_case)]
    fn from_points(
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        camera: &PyCamera,
        T_cp: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let points = array::triples(points, "points")?;
        let pose = T_cp.map(|pose| array::motion_of_cloud(pose, "T_cp"));
        let pose = pose.transpose()?;
        let pose = pose.map_or_else(Isometry3::identity, |pose| pose.isometry);
        let any = !points.is_empty();
        let image = py.detach(|| DepthImage::from_points(points, &camera.0, &pose));
        if any && image.pixels().iter().all(|z| *z == 0.0) {
            let text = "no point is in the image: expected points in front of the camera, meters, \
                        with z forward, or their pose T_cp, camera from points, meters";
            errors::warn(py, text)?;
        }
        check(&image, "divide the points by 1000")?;
        Ok(Self(Arc::new(image)))
    }

    /// Image width, pixels.
    #[getter]
    fn width(&self) -> u32 {
        self.0.width()
    }

    /// Image height, pixels.
    #[getter]
    fn height(&self) -> u32 {
        self.0.height()
    }

    /// Returns a copy as an array.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray, shape (H, W), float32
    ///     Meters; 0 for pixels without a measurement.
    pub(crate) fn to_numpy(&self) -> Matrix<f32> {
        image(self.0.width(), self.0.pixels())
    }

    fn __getnewargs__(&self) -> (Matrix<f32>,) {
        (self.to_numpy(),)
    }

    fn __repr__(&self) -> String {
        format!("DepthImage({}x{})", self.0.width(), self.0.height())
    }
}

/// Returns the image of a `DepthImage`, or reads an array.
pub(crate) fn shared<'py>(
    value: &Bound<'py, PyAny>,
    scale: Option<f64>,
) -> PyResult<Bound<'py, PyDepthImage>> {
    match value.cast::<PyDepthImage>() {
        Ok(image) if scale.is_none() => Ok(image.clone()),
        Ok(_) => Err(InputError::new_err(
            "scale= was passed with depth as a DepthImage, which is in meters: expected scale= \
             where the DepthImage is created",
        )),
        Err(_) => Bound::new(value.py(), PyDepthImage::new(value, scale)?),
    }
}

/// Reads a depth image, meters, in one pass.
fn read(value: &Bound<'_, PyAny>, scale: Option<f64>) -> PyResult<DepthImage> {
    let value = &array::without_channel(array::as_array("depth", value)?)?;
    let array = value
        .cast::<PyUntypedArray>()
        .map_err(|_| unexpected("depth", value, EXPECTED_DEPTH))?;
    if array.ndim() != 2 {
        return Err(unexpected("depth", value, EXPECTED_DEPTH));
    }
    let value = &array::aligned(value)?;
    // Types other than these three are rare, so NumPy converts them.
    let any = || value.extract::<PyArrayLike2<'_, f64, AllowTypeChange>>();
    match (array.dtype().kind(), array.dtype().itemsize()) {
        (b'f', _) => {
            no_scale(scale, array)?;
            if let Ok(meters) = value.extract::<PyReadonlyArray2<'_, f32>>() {
                return convert(&meters.as_array(), |z| z, ADVICE);
            }
            convert(&any()?.as_array(), narrow, ADVICE)
        }
        (b'i' | b'u', 2..) => {
            let scale = scale.ok_or_else(|| {
                InputError::new_err(format!(
                    "depth is {} without scale=, expected {EXPECTED_DEPTH}, such as scale=0.001 \
                     for millimeters",
                    array::describe(array)
                ))
            })?;
            // The same rounding as for depth PNGs: units times millimeters per unit, then to
            // meters.
            let (millimeters, advice) = (millimeters(scale)?, advice_on(scale));
            let meters = |z: f64| narrow(z * millimeters / 1000.0);
            if let Ok(units) = value.extract::<PyReadonlyArray2<'_, u16>>() {
                let meters = |z: u16| match z {
                    DepthImage::SATURATED => 0.0,
                    z => meters(f64::from(z)),
                };
                return convert(&units.as_array(), meters, &advice);
            }
            convert(&any()?.as_array(), meters, &advice)
        }
        _ => Err(unexpected("depth", array, EXPECTED_DEPTH)),
    }
}

/// Checks the unit, then copies, converts and cleans all pixels in one pass.
fn convert<T: Copy>(
    array: &ArrayView2<'_, T>,
    meters: impl Fn(T) -> f32 + Copy,
    advice: &str,
) -> PyResult<DepthImage> {
    let (width, height) = size(array)?;
    check_unit(array, meters, advice)?;
    match array.as_slice() {
        Some(row_major) => DepthImage::collect(width, height, row_major.iter().map(|z| meters(*z))),
        None => DepthImage::collect(width, height, array.iter().map(|z| meters(*z))),
    }
    .map_err(errors::input)
}

/// Reads a mask. `None` selects every pixel.
pub(crate) fn mask(value: Option<&Bound<'_, PyAny>>, depth: &DepthImage) -> PyResult<Mask> {
    let Some(value) = value else {
        return Ok(Mask::full(depth.width(), depth.height()));
    };
    let expected = "an (H, W) array of bool or uint8, not zero on the object, or of other integers \
                    that are 0 and 1, or 0 and 255; pass mask > 0.5 for probabilities, mask > 0 for \
                    logits, or mask == N for a label image";
    let value = &array::without_channel(array::as_array("mask", value)?)?;
    let refuse = || unexpected("mask", value, expected);
    let kind = value.cast::<PyUntypedArray>().map_err(|_| refuse())?;
    let kind = kind.dtype().kind();
    let bytes = match kind {
        // Pictures of PIL have other bytes than 0 and 1 as bool, which are no bool of Rust.
        b'b' => value.call_method1("view", ("uint8",))?,
        _ => value.clone(),
    };
    let (set, size) = if let Ok(mask) = bytes.extract::<PyReadonlyArray2<'_, u8>>() {
        let mask = mask.as_array();
        if kind != b'b' {
            warn_of_labels(value, &mask)?;
        }
        let set = array::row_major(&mask)
            .into_iter()
            .map(|m| m != 0)
            .collect();
        (set, size(&mask)?)
    } else if matches!(kind, b'i' | b'u')
        && let Ok(mask) = value.extract::<PyArrayLike2<'_, i64, AllowTypeChange>>()
        && let mask = mask.as_array()
        && [1, 255]
            .iter()
            .any(|on| mask.iter().all(|m| *m == 0 || m == on))
    {
        (mask.iter().map(|m| *m != 0).collect(), size(&mask)?)
    } else {
        return Err(refuse());
    };
    if size != depth.size() {
        return Err(InputError::new_err(format!(
            "mask is {}, expected the shape of depth, ({}, {})",
            array::describe(value),
            depth.height(),
            depth.width()
        )));
    }
    Mask::new(size.0, size.1, set).map_err(errors::input)
}

/// Warns of a mask with several values above 0.
fn warn_of_labels(value: &Bound<'_, PyAny>, mask: &ArrayView2<'_, u8>) -> PyResult<()> {
    let mut seen = [false; 256];
    mask.iter().for_each(|m| seen[usize::from(*m)] = true);
    let values: Vec<usize> = (1..256).filter(|m| seen[*m]).collect();
    if let [first, _, .., last] | [first, last] = values[..] {
        let text = format!(
            "mask has {} values from {first} to {last}: expected one object; pass mask == N for a \
             label image, or mask >= 128 for a soft mask",
            values.len()
        );
        errors::warn(value.py(), &text)?;
    }
    Ok(())
}

/// Returns the median of the measured depths, or `None` if there are none.
fn median(depths: impl Iterator<Item = f32>) -> Option<f32> {
    let mut positive: Vec<f32> = depths.filter(|z| *z > 0.0 && z.is_finite()).collect();
    internal::median(&mut positive, f32::total_cmp)
}

/// Returns an image that Python receives as an array of shape (H, W).
pub(crate) fn image<T: Copy>(width: u32, pixels: &[T]) -> Matrix<T> {
    Matrix::new(width as usize, pixels.to_vec())
}

fn no_scale(scale: Option<f64>, depth: &Bound<'_, PyAny>) -> PyResult<()> {
    match scale {
        None => Ok(()),
        Some(scale) => Err(InputError::new_err(format!(
            "scale={scale} was passed with depth as {}, which is in meters: expected scale= only \
             with integers",
            array::describe(depth)
        ))),
    }
}

/// Returns width and height.
fn size<T>(array: &ArrayView2<'_, T>) -> PyResult<(u32, u32)> {
    let side = |length: usize| {
        u32::try_from(length).map_err(|_| {
            InputError::new_err(format!(
                "an image side is {length} pixels, expected at most {}",
                u32::MAX
            ))
        })
    };
    Ok((side(array.ncols())?, side(array.nrows())?))
}

/// Returns the millimeters per unit of a `scale`, which is in meters per unit.
pub(crate) fn millimeters(scale: f64) -> PyResult<f64> {
    if scale.is_finite() && scale > 0.0 {
        return Ok(scale * 1000.0);
    }
    Err(InputError::new_err(format!(
        "scale is {scale}, expected meters per unit above 0, such as 0.001 for millimeters"
    )))
}

/// Returns the advice for depths that are too large at a scale.
pub(crate) fn advice_on(scale: f64) -> String {
    format!(
        "scale={scale} is in meters per unit; for {scale} mm per unit, as depth_scale of BOP, pass \
         scale={}",
        scale / 1000.0
    )
}

/// Returns an error if the depths of an image cannot be in meters.
pub(crate) fn check(image: &DepthImage, advice: &str) -> PyResult<()> {
    let shape = (image.height() as usize, image.width() as usize);
    let array = ArrayView2::from_shape(shape, image.pixels()).map_err(errors::input)?;
    check_unit(&array, |z| z, advice)
}

/// Returns an error if the depths cannot be in meters. `advice` corrects depths that are too large.
///
/// Reads the pixels of a grid. If none of them was measured, reads all pixels.
fn check_unit<T: Copy>(
    array: &ArrayView2<'_, T>,
    meters: impl Fn(T) -> f32 + Copy,
    advice: &str,
) -> PyResult<()> {
    let stride = |side: usize| side.div_ceil(GRID).max(1);
    let (down, right) = (stride(array.nrows()), stride(array.ncols()));
    let rows = (down / 2..array.nrows()).step_by(down);
    let grid = rows.flat_map(|v| {
        let columns = (right / 2..array.ncols()).step_by(right);
        columns.map(move |u| meters(array[(v, u)]))
    });
    let Some(middle) = median(grid).or_else(|| median(array.iter().map(|z| meters(*z)))) else {
        return Ok(());
    };
    if middle > MAX_MEDIAN_METERS {
        return Err(InputError::new_err(format!(
            "depth looks like millimeters: median {middle:.0}, expected meters ({advice})"
        )));
    }
    if middle < MIN_MEDIAN_METERS {
        return Err(InputError::new_err(format!(
            "depth looks too small for meters: median {middle:e}, expected at least \
             {MIN_MEDIAN_METERS} (scale it only once)"
        )));
    }
    Ok(())
}

// Images have the precision of f32. Values that overflow become infinite, hence missing.
#[allow(clippy::cast_possible_truncation)]
fn narrow(z: f64) -> f32 {
    z as f32
}
