//! Depth images and masks out of NumPy arrays.

use hybrid_icp::{DepthImage, Mask};
use numpy::{Element, PyArray2, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::array::{self, unexpected};
use crate::errors::{self, InputError};

const EXPECTED_DEPTH: &str =
    "an (H, W) array of float32 metres, or of uint16 together with scale= (metres per unit)";

/// Medians beyond this many metres are taken for millimetres; those of real millimetres are above it, as no camera sees so near.
const MAX_MEDIAN_METERS: f32 = 100.0;

/// Medians below this many metres are taken for metres that were scaled twice.
const MIN_MEDIAN_METERS: f32 = 0.01;

/// Pixels that a median is taken of.
const MEDIAN_SAMPLES: usize = 1024;

/// Reads a depth image, metres.
pub(crate) fn depth(value: &Bound<'_, PyAny>, scale: Option<f64>) -> PyResult<DepthImage> {
    let array = value
        .cast::<PyUntypedArray>()
        .map_err(|_| unexpected("depth", value, EXPECTED_DEPTH))?;
    if array.ndim() != 2 {
        return Err(unexpected("depth", value, EXPECTED_DEPTH));
    }
    let (meters, size) = if let Ok(meters) = value.extract::<PyReadonlyArray2<'_, f32>>() {
        no_scale(scale, value)?;
        (pixels(&meters), size(&meters)?)
    } else if let Ok(meters) = value.extract::<PyReadonlyArray2<'_, f64>>() {
        no_scale(scale, value)?;
        let pixels = meters.as_array().iter().map(|z| narrow(*z)).collect();
        (pixels, size(&meters)?)
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
        let meters = units.as_array();
        let meters = meters
            .iter()
            .map(|z| narrow(f64::from(*z) * scale / 1000.0));
        (meters.collect(), size(&units)?)
    } else {
        return Err(unexpected("depth", value, EXPECTED_DEPTH));
    };
    check_unit(&meters)?;
    DepthImage::from_meters(size.0, size.1, meters).map_err(errors::input)
}

/// Reads a mask; `None` is every pixel.
pub(crate) fn mask(value: Option<&Bound<'_, PyAny>>, depth: &DepthImage) -> PyResult<Mask> {
    let Some(value) = value else {
        return Ok(Mask::full(depth.width(), depth.height()));
    };
    let expected = "an (H, W) array of bool or uint8, not zero on the object";
    let (set, size) = if let Ok(mask) = value.extract::<PyReadonlyArray2<'_, bool>>() {
        (pixels(&mask), size(&mask)?)
    } else if let Ok(mask) = value.extract::<PyReadonlyArray2<'_, u8>>() {
        (
            mask.as_array().iter().map(|m| *m != 0).collect(),
            size(&mask)?,
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

/// Returns the median of the positive depths at the pixels chosen, of at most [`MEDIAN_SAMPLES`] of them; `None` without any.
pub(crate) fn median(depths: impl Iterator<Item = f32> + Clone) -> Option<f32> {
    let positive = || depths.clone().filter(|z| *z > 0.0);
    let stride = positive().count().div_ceil(MEDIAN_SAMPLES).max(1);
    let mut sample: Vec<f32> = positive().step_by(stride).collect();
    sample.sort_by(f32::total_cmp);
    sample.get(sample.len() / 2).copied()
}

/// Makes an array of an image.
pub(crate) fn image<'py, T: Element>(
    py: Python<'py>,
    width: u32,
    pixels: Vec<T>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    array::matrix(py, width as usize, pixels)
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

fn pixels<T: Element + Copy>(array: &PyReadonlyArray2<'_, T>) -> Vec<T> {
    array::row_major(&array.as_array())
}

/// Width and height.
fn size<T: Element>(array: &PyReadonlyArray2<'_, T>) -> PyResult<(u32, u32)> {
    let side = |length: usize| {
        u32::try_from(length).map_err(|_| {
            InputError::new_err(format!("image side is {length} pixels, expected fewer"))
        })
    };
    Ok((side(array.shape()[1])?, side(array.shape()[0])?))
}

/// Refuses what cannot be metres.
fn check_unit(pixels: &[f32]) -> PyResult<()> {
    // A coarse look first: most images are told by every 64th pixel, and reading all of a large one costs more than copying it.
    let coarse = median(pixels.iter().step_by(64).copied());
    let Some(middle) = coarse.or_else(|| median(pixels.iter().copied())) else {
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
