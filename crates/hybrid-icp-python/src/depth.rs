//! `DepthImage`, and masks out of NumPy arrays.

use std::path::PathBuf;
use std::sync::Arc;

use hybrid_icp::core::{DepthImage, Mask};
use numpy::ndarray::ArrayView2;
use numpy::{PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::array::{self, Matrix, unexpected};
use crate::errors::{self, InputError};

const EXPECTED_DEPTH: &str =
    "an (H, W) array of float32 metres, or of uint16 together with scale= (metres per unit)";

/// Medians beyond this many metres are taken for millimetres; those of real millimetres are above
/// it, as no camera sees so near.
const MAX_MEDIAN_METERS: f32 = 100.0;

/// Medians below this many metres are taken for metres that were scaled twice.
const MIN_MEDIAN_METERS: f32 = 0.01;

/// Rows and columns of the grid of pixels by which an image is judged before the others are looked
/// at.
const GRID: usize = 64;

/// A depth image to be shared by the observations of its objects: read and checked once, however
/// many masks there are.
///
/// The array is read in one pass, which copies it: other threads may write to it while the GIL is
/// released. Masks share the copy.
///
/// Parameters
/// ----------
/// depth : numpy.ndarray, shape (H, W)
///     Depth along the optical axis: float32 (or float64) metres, or uint16 with `scale`. 0,
///     negative or NaN where nothing was measured.
/// scale : float, optional
///     Metres per unit of a uint16 image, such as 0.001; BOP's `depth_scale` divided by 1000.
///
/// Raises
/// ------
/// InputError
///     When shape, dtype or unit do not fit, saying what was passed and what was expected.
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

    /// Reads a 16-bit grey PNG, without an array between.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    /// scale : float
    ///     Metres per unit, such as 0.001; BOP's `depth_scale` divided by 1000.
    ///
    /// Returns
    /// -------
    /// DepthImage
    ///
    /// Raises
    /// ------
    /// FileError
    ///     When the file cannot be read or is no such image.
    #[staticmethod]
    pub(crate) fn from_png(py: Python<'_>, path: PathBuf, scale: f64) -> PyResult<Self> {
        py.detach(|| hicp_io::read_depth_png(&path, scale * 1000.0))
            .map(|image| Self(Arc::new(image)))
            .map_err(errors::file)
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
    ///     Metres, 0 where nothing was measured.
    pub(crate) fn to_numpy(&self) -> Matrix<f32> {
        image(self.0.width(), self.0.pixels())
    }

    fn __repr__(&self) -> String {
        format!("DepthImage({}x{})", self.0.width(), self.0.height())
    }
}

/// Takes a `DepthImage` as it is, or reads an array.
pub(crate) fn shared(value: &Bound<'_, PyAny>, scale: Option<f64>) -> PyResult<Arc<DepthImage>> {
    match value.cast::<PyDepthImage>() {
        Ok(image) if scale.is_none() => Ok(Arc::clone(&image.get().0)),
        Ok(_) => Err(InputError::new_err(
            "scale= was passed with depth as a DepthImage, expected it when the DepthImage is made: its depths are metres",
        )),
        Err(_) => read(value, scale).map(Arc::new),
    }
}

/// Reads a depth image, metres, in one pass.
fn read(value: &Bound<'_, PyAny>, scale: Option<f64>) -> PyResult<DepthImage> {
    let array = value
        .cast::<PyUntypedArray>()
        .map_err(|_| unexpected("depth", value, EXPECTED_DEPTH))?;
    if array.ndim() != 2 {
        return Err(unexpected("depth", value, EXPECTED_DEPTH));
    }
    let value = &array::aligned(value)?;
    if let Ok(meters) = value.extract::<PyReadonlyArray2<'_, f32>>() {
        no_scale(scale, value)?;
        convert(&meters.as_array(), |z| z)
    } else if let Ok(meters) = value.extract::<PyReadonlyArray2<'_, f64>>() {
        no_scale(scale, value)?;
        convert(&meters.as_array(), narrow)
    } else if let Ok(units) = value.extract::<PyReadonlyArray2<'_, u16>>() {
        let scale = scale.ok_or_else(|| {
            InputError::new_err(format!(
                "depth is {} without scale=, expected {EXPECTED_DEPTH}, such as scale=0.001 for millimetres",
                array::describe(value)
            ))
        })?;
        if !(scale.is_finite() && scale > 0.0) {
            return Err(InputError::new_err(format!(
                "scale is {scale}, expected metres per unit above 0, such as 0.001 for millimetres"
            )));
        }
        // As depth PNGs are read: units times millimetres per unit, brought to metres.
        let scale = scale * 1000.0;
        convert(&units.as_array(), |z| narrow(f64::from(z) * scale / 1000.0))
    } else {
        Err(unexpected("depth", value, EXPECTED_DEPTH))
    }
}

/// Judges the unit by some pixels, then copies, converts and cleans all of them in one go.
fn convert<T: Copy>(
    array: &ArrayView2<'_, T>,
    meters: impl Fn(T) -> f32 + Copy,
) -> PyResult<DepthImage> {
    let (width, height) = size(array)?;
    check_unit(array, meters)?;
    match array.as_slice() {
        Some(row_major) => DepthImage::collect(width, height, row_major.iter().map(|z| meters(*z))),
        None => DepthImage::collect(width, height, array.iter().map(|z| meters(*z))),
    }
    .map_err(errors::input)
}

/// Reads a mask; `None` is every pixel.
pub(crate) fn mask(value: Option<&Bound<'_, PyAny>>, depth: &DepthImage) -> PyResult<Mask> {
    let Some(value) = value else {
        return Ok(Mask::full(depth.width(), depth.height()));
    };
    let expected = "an (H, W) array of bool or uint8, not zero on the object";
    let (set, size) = if let Ok(mask) = value.extract::<PyReadonlyArray2<'_, bool>>() {
        (array::row_major(&mask.as_array()), size(&mask.as_array())?)
    } else if let Ok(mask) = value.extract::<PyReadonlyArray2<'_, u8>>() {
        (
            mask.as_array().iter().map(|m| *m != 0).collect(),
            size(&mask.as_array())?,
        )
    } else {
        return Err(unexpected("mask", value, expected));
    };
    if size != (depth.width(), depth.height()) {
        return Err(InputError::new_err(format!(
            "mask is {}, expected the shape of depth, ({}, {})",
            array::describe(value),
            depth.height(),
            depth.width()
        )));
    }
    Mask::new(size.0, size.1, set).map_err(errors::input)
}

/// Returns the median of the positive depths; `None` without any.
pub(crate) fn median(depths: impl Iterator<Item = f32>) -> Option<f32> {
    let mut positive: Vec<f32> = depths.filter(|z| *z > 0.0).collect();
    let middle = positive.len() / 2;
    (middle < positive.len()).then(|| *positive.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Returns the strides at which at most 64 × 64 pixels of an area of some height and width are
/// looked at.
pub(crate) fn strides(height: usize, width: usize) -> (usize, usize) {
    (height.div_ceil(GRID).max(1), width.div_ceil(GRID).max(1))
}

/// Returns an image that Python receives as an array of shape (H, W).
pub(crate) fn image<T: Copy>(width: u32, pixels: &[T]) -> Matrix<T> {
    Matrix::new(width as usize, pixels.to_vec())
}

fn no_scale(scale: Option<f64>, depth: &Bound<'_, PyAny>) -> PyResult<()> {
    match scale {
        None => Ok(()),
        Some(scale) => Err(InputError::new_err(format!(
            "scale={scale} was passed with depth as {}, expected scale= with uint16 only: floats are metres",
            array::describe(depth)
        ))),
    }
}

/// Width and height.
fn size<T>(array: &ArrayView2<'_, T>) -> PyResult<(u32, u32)> {
    let side = |length: usize| {
        u32::try_from(length).map_err(|_| {
            InputError::new_err(format!("image side is {length} pixels, expected fewer"))
        })
    };
    Ok((side(array.ncols())?, side(array.nrows())?))
}

/// Refuses what cannot be metres, by pixels on a grid; by all of them only where none of those was
/// measured.
fn check_unit<T: Copy>(
    array: &ArrayView2<'_, T>,
    meters: impl Fn(T) -> f32 + Copy,
) -> PyResult<()> {
    let (down, right) = strides(array.nrows(), array.ncols());
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
            "depth looks like millimetres: median {middle:.0}, expected metres (divide by 1000, or pass uint16 with scale=0.001)"
        )));
    }
    if middle < MIN_MEDIAN_METERS {
        return Err(InputError::new_err(format!(
            "depth looks too small for metres: median {middle:e}, expected metres: was it scaled twice?"
        )));
    }
    Ok(())
}

#[allow(clippy::cast_possible_truncation)] // f32 is the precision of images; what overflows becomes infinite and is refused as missing.
fn narrow(z: f64) -> f32 {
    z as f32
}
