//! What can be wrong with the inputs of a score.

use thiserror::Error;

/// Inputs that no score can be computed from.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ScoreError {
    /// Images that should be of one size are not.
    #[error("{what} is {}x{}, expected {}x{}", found.0, found.1, expected.0, expected.1)]
    Size {
        /// Which image.
        what: &'static str,
        /// Its width and height.
        found: (u32, u32),
        /// The width and height of the others.
        expected: (u32, u32),
    },
    /// A diameter that is not finite and positive.
    #[error("diameter is {value}, expected a finite number above 0")]
    Diameter {
        /// The value given.
        value: f64,
    },
    /// An image that cannot be made.
    #[error(transparent)]
    Image(#[from] hicp_core::ImageError),
}
