//! Color images.

use crate::sensor::image::error::ImageError;
use crate::sensor::image::raster::{Raster, image_accessors};

/// A color image: red, green and blue of each pixel, 0 to 255, as a camera or a file encodes them.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorImage(Raster<[u8; 3]>);

impl ColorImage {
    /// Creates a color image, row by row.
    ///
    /// # Errors
    ///
    /// [`ImageError::PixelCount`] if `pixels` does not hold `width * height` values.
    pub fn new(width: u32, height: u32, pixels: Vec<[u8; 3]>) -> Result<Self, ImageError> {
        Raster::new(width, height, pixels).map(Self)
    }

    /// Creates a color image from red, green and blue bytes in turn, row by row.
    ///
    /// # Errors
    ///
    /// [`ImageError::PixelCount`] if `bytes` does not hold `3 * width * height` values.
    pub fn from_rgb(width: u32, height: u32, bytes: &[u8]) -> Result<Self, ImageError> {
        let (pixels, rest) = bytes.as_chunks();
        if !rest.is_empty() {
            return Err(ImageError::PixelCount {
                width,
                height,
                expected: 3 * width as usize * height as usize,
                found: bytes.len(),
            });
        }
        Self::new(width, height, pixels.to_vec())
    }

    image_accessors!([u8; 3]);
}
