//! Errors of simulations.

use std::ops::RangeInclusive;

use hicp_core::{DepthImage, ImageError, MeshError, PinholeCamera, internal};
use thiserror::Error;

/// The reason why a simulation is impossible.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SimError {
    /// A parameter is out of its range.
    #[error("{what} is {value}, expected {expected}")]
    Parameter {
        /// Name of the parameter.
        what: &'static str,
        /// The value given.
        value: f64,
        /// The expected values.
        expected: String,
    },
    /// The diameter of an object leaves no distance to the camera to draw.
    #[error(
        "{object} has a diameter of {diameter} m, expected less than the largest distance to the camera, {max_distance} m"
    )]
    TooLarge {
        /// Name of the object.
        object: String,
        /// Its diameter, meters.
        diameter: f64,
        /// The configured largest distance, meters.
        max_distance: f64,
    },
    /// No initial pose fell into the bin of a case.
    #[error(
        "bin {bin} of {bins} (VSD {low} to {high}) of {object} could not be filled for case {index}: none of {tried} initial poses fell into it, around {poses} object poses"
    )]
    UnfilledBin {
        /// Name of the object.
        object: String,
        /// Index of the case.
        index: u64,
        /// The bin, from 0.
        bin: usize,
        /// Number of bins.
        bins: usize,
        /// Lower end of the bin.
        low: f64,
        /// Upper end of the bin.
        high: f64,
        /// Number of initial poses tried.
        tried: u32,
        /// Number of object poses around which they were tried.
        poses: u32,
    },
    /// The text is not the name of a noise model.
    #[error(
        "{text:?} is not a depth noise, expected none, relative:PERCENT, axial:C0,C1,C2, d435-ahn2019-axial, stereo:FOCAL_PIXELS,BASELINE_METERS,SUBPIXEL,QUANTIZATION_PIXELS or d435-nominal-stereo"
    )]
    NoiseName {
        /// The text given.
        text: String,
    },
    /// A volume would have too many voxels, or too few along an axis.
    #[error(
        "the volume has {}x{}x{} voxels, expected at most {limit} voxels and at least 2 along each axis",
        .size[0], .size[1], .size[2]
    )]
    VolumeSize {
        /// Voxels along x, y and z.
        size: [usize; 3],
        /// The largest number of voxels.
        limit: usize,
    },
    /// A volume does not contain a surface.
    #[error(
        "the volume contains no surface: no two neighboring voxels differ in sign after {images} images"
    )]
    NoSurface {
        /// Number of integrated images.
        images: u32,
    },
    /// The sizes of images do not match.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A mesh is invalid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Returns an error if a value is not in a closed range.
pub(crate) fn check_range(
    what: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
) -> Result<(), SimError> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(SimError::Parameter {
        what,
        value,
        expected: format!("a number from {} to {}", range.start(), range.end()),
    })
}

/// Returns an error if a depth image has another size than its camera.
pub(crate) fn check_size(depth: &DepthImage, camera: &PinholeCamera) -> Result<(), SimError> {
    internal::check_size("depth image", depth.size(), "camera", camera.size())?;
    Ok(())
}
