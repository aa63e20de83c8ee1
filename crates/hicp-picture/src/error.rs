//! Errors of drawing.

use hicp_core::{CameraError, ImageError};

/// A picture that cannot be drawn or encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// A text cannot be drawn.
    #[error("cannot write {text:?}: {reason}")]
    Text {
        /// The text.
        text: String,
        /// The reason.
        reason: String,
    },
    /// A picture with its legend has too many rows.
    #[error("{rows} rows, expected at most {}", i32::MAX)]
    Rows {
        /// The number of rows.
        rows: u64,
    },
    /// A picture or the shown part of an image has a size that no camera can have.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The shown part of an image is not a valid image.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A picture cannot be encoded.
    #[error("cannot encode a picture: {0}")]
    Encoding(#[from] png::EncodingError),
}
