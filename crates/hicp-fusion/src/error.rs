//! What can be wrong with the inputs of fusion.

use thiserror::Error;

use crate::estimate::{MAX_TRANSLATION_METERS, MAX_VARIANCE};

/// An estimate, a motion or a parameter that cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum FusionError {
    /// A translation that is not finite or absurdly large.
    #[error(
        "translation of {what} is ({x}, {y}, {z}) m, expected finite numbers within ±{} m",
        MAX_TRANSLATION_METERS
    )]
    Translation {
        /// What the translation belongs to.
        what: &'static str,
        /// x.
        x: f64,
        /// y.
        y: f64,
        /// z.
        z: f64,
    },
    /// A rotation whose quaternion is not finite and of unit length.
    #[error("rotation of {what} has a quaternion of length {norm}, expected 1")]
    Rotation {
        /// What the rotation belongs to.
        what: &'static str,
        /// Length of the quaternion.
        norm: f64,
    },
    /// A covariance with an entry that is not finite or absurdly large.
    #[error(
        "covariance entry [{row}][{column}] is {value}, expected a finite number within ±{:e}",
        MAX_VARIANCE
    )]
    CovarianceEntry {
        /// Row from 0.
        row: usize,
        /// Column from 0.
        column: usize,
        /// The value given.
        value: f64,
    },
    /// A covariance that is not symmetric.
    #[error(
        "covariance is not symmetric: entry [{row}][{column}] is {value} and its mirror image {mirrored}"
    )]
    CovarianceAsymmetric {
        /// Row from 0.
        row: usize,
        /// Column from 0.
        column: usize,
        /// The value there.
        value: f64,
        /// The value at the mirrored place.
        mirrored: f64,
    },
    /// A covariance with a negative eigenvalue.
    #[error("covariance has the eigenvalue {eigenvalue}, expected 0 or more")]
    CovarianceNegative {
        /// The smallest eigenvalue.
        eigenvalue: f64,
    },
    /// A mean VSD estimate out of range.
    #[error("mean VSD estimate is {value}, expected 0 to 1")]
    Mve {
        /// The value given.
        value: f64,
    },
    /// A parameter out of range.
    #[error("{name} is {value}, expected {expected}")]
    Parameter {
        /// Which one.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// Nothing to fuse.
    #[error("no estimate to fuse, expected one or more")]
    Empty,
}
