//! Reads PNG files.

use std::path::PathBuf;

use pyo3::prelude::*;

use crate::array::Matrix;
use crate::depth::{self, PyDepthImage};
use crate::errors;

/// Reads a 16-bit gray PNG as an array of meters.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
/// scale : float
///     Meters per unit, such as 0.001; BOP's `depth_scale` divided by 1000.
///
/// Returns
/// -------
/// numpy.ndarray, shape (H, W), float32
///     Meters; 0 for pixels without a measurement.
#[pyfunction]
pub(crate) fn read_depth_png(py: Python<'_>, path: PathBuf, scale: f64) -> PyResult<Matrix<f32>> {
    Ok(PyDepthImage::from_png(py, path, scale)?.to_numpy())
}

/// Reads a mask from a PNG that is nonzero on the object.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///
/// Returns
/// -------
/// numpy.ndarray, shape (H, W), bool
#[pyfunction]
pub(crate) fn read_mask_png(py: Python<'_>, path: PathBuf) -> PyResult<Matrix<bool>> {
    py.detach(|| hicp_io::read_mask_png(&path))
        .map(|mask| depth::image(mask.width(), mask.pixels()))
        .map_err(errors::file)
}
