//! Images whose values or sizes do not fit.

use thiserror::Error;

/// Returns an error that names both sides if their widths or heights differ.
///
/// # Errors
///
/// [`ImageError::SizeMismatch`] if the sizes differ.
pub fn check_size(
    first: &'static str,
    first_size: (u32, u32),
    second: &'static str,
    second_size: (u32, u32),
) -> Result<(), ImageError> {
    if first_size == second_size {
        Ok(())
    } else {
        Err(ImageError::SizeMismatch {
            first,
            first_width: first_size.0,
            first_height: first_size.1,
            second,
            second_width: second_size.0,
            second_height: second_size.1,
        })
    }
}

/// The reason why values do not form an image, or why two images do not match.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageError {
    /// The number of values is not width × height.
    #[error("image of {width}x{height} needs {expected} values, found {found}")]
    PixelCount {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// width × height.
        expected: usize,
        /// The number of values given.
        found: usize,
    },
    /// Two sides that must have the same size differ.
    #[error(
        "{first} is {first_width}x{first_height} but {second} is {second_width}x{second_height}: expected the same size"
    )]
    SizeMismatch {
        /// The name of the first side.
        first: &'static str,
        /// Width of the first.
        first_width: u32,
        /// Height of the first.
        first_height: u32,
        /// The name of the second side.
        second: &'static str,
        /// Width of the second.
        second_width: u32,
        /// Height of the second.
        second_height: u32,
    },
    /// The window of normals is too small or too large.
    #[error("window of normals has a half side of {found} pixels, expected 1 to 10")]
    NormalWindow {
        /// The half side given.
        found: u8,
    },
}
