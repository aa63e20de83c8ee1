//! PNG files.

use std::path::PathBuf;

use numpy::PyArray2;
use pyo3::prelude::*;

use crate::depth;
use crate::errors;

/// Reads a 16-bit grey PNG as metres.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
/// scale : float
///     Metres per unit, such as 0.001; BOP's `depth_scale` divided by 1000.
///
/// Returns
/// -------
/// numpy.ndarray, shape (H, W), float32
///     Metres, 0 where nothing was measured.
#[pyfunction]
pub(crate) fn read_depth_png(
    py: Python<'_>,
    path: PathBuf,
    scale: f64,
) -> PyResult<Bound<'_, PyArray2<f32>>> {
    let image = py
        .detach(|| hicp_io::read_depth_png(&path, scale * 1000.0))
        .map_err(errors::file)?;
    depth::image(py, image.width(), image.pixels().to_vec())
}

/// Reads a mask: a PNG that is not zero on the object.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///
/// Returns
/// -------
/// numpy.ndarray, shape (H, W), bool
#[pyfunction]
pub(crate) fn read_mask_png(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray2<bool>>> {
    let mask = py
        .detach(|| hicp_io::read_mask_png(&path))
        .map_err(errors::file)?;
    depth::image(py, mask.width(), mask.pixels().to_vec())
}
