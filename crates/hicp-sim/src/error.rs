//! What can go wrong in a simulation.

use std::ops::RangeInclusive;

use hicp_core::{ImageError, MeshError};
use thiserror::Error;

/// Why a simulation could not be made.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SimError {
    /// A parameter is out of its range.
    #[error("{what} is {value}, expected {expected}")]
    Parameter {
        /// The parameter.
        what: &'static str,
        /// The value given.
        value: f64,
        /// What was expected.
        expected: String,
    },
    /// The object is as large as the largest distance to the camera, so that no distance is left to draw.
    #[error(
        "{object} has a diameter of {diameter} m, expected less than the largest distance to the camera, {max_distance} m"
    )]
    TooLarge {
        /// Name of the object.
        object: String,
        /// Its diameter, metres.
        diameter: f64,
        /// The largest distance configured, metres.
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
        /// Where the bin begins.
        low: f64,
        /// Where the bin ends.
        high: f64,
        /// Number of initial poses tried.
        tried: u32,
        /// Number of object poses they were tried around.
        poses: u32,
    },
    /// The words do not name a noise model.
    #[error(
        "{text:?} is no depth noise, expected none, relative:PERCENT, axial:C0,C1,C2, d435-ahn2019-axial, stereo:FOCAL_PIXELS,BASELINE_METERS,SUBPIXEL,QUANTIZATION_PIXELS or d435-nominal-stereo"
    )]
    NoiseName {
        /// What was given.
        text: String,
    },
    /// A volume would hold more voxels than are allowed.
    #[error(
        "a volume of {x}x{y}x{z} voxels was asked for, expected at most {limit} voxels and at least 2 along each axis"
    )]
    VolumeSize {
        /// Voxels along x.
        x: usize,
        /// Voxels along y.
        y: usize,
        /// Voxels along z.
        z: usize,
        /// The largest number.
        limit: usize,
    },
    /// A volume holds no surface.
    #[error(
        "the volume holds no surface: no two neighbouring voxels differ in sign after {images} images"
    )]
    NoSurface {
        /// Images integrated.
        images: u32,
    },
    /// Images do not fit together.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A mesh could not be made.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Returns an error unless a value lies in a closed range.
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
