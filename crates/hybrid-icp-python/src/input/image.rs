//! Reads images and poses from files.

use std::path::PathBuf;

use hicp_io::{IoError, LengthUnit, MaskRule, ReadLimits};
use pyo3::prelude::*;

use crate::array::{self, Matrix};
use crate::errors::{self, InputError};
use crate::input::depth::{self, PyDepthImage};

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

/// Reads a depth image as an array of meters, from a file of any supported format.
///
/// PNG, TIFF, NPY, NPZ, EXR, PGM and PFM files are recognized by their first bytes.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
/// scale : float, optional
///     Meters per unit, such as 0.001 for integers of millimeters. Floating point is in meters if
///     not given.
///
/// Returns
/// -------
/// numpy.ndarray, shape (H, W), float32
///     Meters; 0 for pixels without a measurement.
///
/// Raises
/// ------
/// FileError
///     If the file cannot be read, is not such an image, or has integers and `scale` is missing.
/// InputError
///     If `scale` is wrong, or if the depths at this scale cannot be meters.
#[pyfunction]
#[pyo3(signature = (path, *, scale = None))]
pub(crate) fn read_depth(
    py: Python<'_>,
    path: PathBuf,
    scale: Option<f64>,
) -> PyResult<Matrix<f32>> {
    let millimeters = scale.map(depth::millimeters).transpose()?;
    let image = py.detach(|| {
        let raw = ReadLimits::DEFAULT.read_raw_depth(&path)?;
        if millimeters.is_none() && !raw.is_float() {
            let expected = "floating-point meters, or scale= (meters per unit), such as 0.001 for \
                            millimeters";
            return Err(IoError::new(path, None, "integers", expected));
        }
        raw.scaled(millimeters)
    });
    let image = image.map_err(errors::file)?;
    if let Some(scale) = scale {
        depth::check(&image, &depth::advice_on(scale))?;
    }
    Ok(depth::image(image.width(), image.pixels()))
}

/// Reads a mask from a file of any supported format.
///
/// PNG, TIFF, BMP, NPY, NPZ and PGM files are recognized by their first bytes. If the opacity of an
/// image varies, it is the value of its pixels.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
/// threshold : float, optional
///     Smallest value on the object, such as 128 or 0.5. For soft masks and probabilities.
/// value : float, optional
///     Value on the object, such as 3. For label images.
///
/// Returns
/// -------
/// numpy.ndarray, shape (H, W), bool
///     Without `threshold` and `value`: the pixels that are not 0, and with a PNG or BMP palette
///     those that are neither black nor transparent.
///
/// Raises
/// ------
/// FileError
///     If the file cannot be read, is not such an image, or has no pixel of the stated value.
/// InputError
///     If both `threshold` and `value` are passed.
///
/// Warns
/// -----
/// InputWarning
///     If neither is passed, and the file has more than two values.
#[pyfunction]
#[pyo3(signature = (path, *, threshold = None, value = None))]
pub(crate) fn read_mask(
    py: Python<'_>,
    path: PathBuf,
    threshold: Option<f64>,
    value: Option<f64>,
) -> PyResult<Matrix<bool>> {
    let rule = match (threshold, value) {
        (None, None) => MaskRule::NotZero,
        (Some(least), None) => MaskRule::AtLeast(least),
        (None, Some(value)) => MaskRule::Equal(value),
        _ => {
            let text = "threshold= and value= were both passed, expected one of them";
            return Err(InputError::new_err(text));
        }
    };
    let file = py.detach(|| hicp_io::read_mask(&path, rule));
    let file = file.map_err(errors::file)?;
    if let Some(warning) = file.warning {
        // The options of the program are arguments here.
        let warning = warning.replace("--mask-threshold ", "threshold=");
        let warning = warning.replace("--mask-value ", "value=");
        errors::warn(py, &format!("{}: {warning}", path.display()))?;
    }
    Ok(depth::image(file.mask.width(), file.mask.pixels()))
}

/// Reads a pose from a JSON, YAML, XML, text, NPY or NPZ file.
///
/// The file has a 4x4 or 3x4 matrix, BOP's `cam_R_m2c` and `cam_t_m2c`, a rotation and a
/// translation, a translation and a quaternion of stated order or an `rvec`, or a TUM line.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
/// unit : {"m", "mm", "cm"}, optional
///     Unit of the translation. If not given, "mm" for `cam_t_m2c` and "m" for all other forms.
///
/// Returns
/// -------
/// numpy.ndarray, shape (4, 4), float64
///     The pose, meters.
///
/// Raises
/// ------
/// FileError
///     If the file cannot be read or has no such pose.
#[pyfunction]
#[pyo3(signature = (path, *, unit = None))]
pub(crate) fn read_pose(py: Python<'_>, path: PathBuf, unit: Option<&str>) -> PyResult<Matrix> {
    let unit = unit.map(str::parse::<LengthUnit>).transpose();
    let unit = unit.map_err(InputError::new_err)?;
    py.detach(|| hicp_io::read_pose(&path, unit))
        .map(|file| Matrix::new(4, array::to_matrix(&file.camera_from_object).to_vec()))
        .map_err(errors::file)
}
