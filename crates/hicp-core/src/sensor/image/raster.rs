//! Storage that all images share.

use crate::sensor::image::error::ImageError;

/// A row-major image of any pixel type.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Raster<T> {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pixels: Vec<T>,
}

impl<T: Copy> Raster<T> {
    pub(super) fn new(width: u32, height: u32, pixels: Vec<T>) -> Result<Self, ImageError> {
        let expected = width as usize * height as usize;
        if pixels.len() != expected {
            return Err(ImageError::PixelCount {
                width,
                height,
                expected,
                found: pixels.len(),
            });
        }
        Ok(Self {
            width,
            height,
            pixels,
        })
    }

    pub(super) fn get(&self, u: u32, v: u32) -> Option<T> {
        (u < self.width && v < self.height)
            .then(|| self.pixels[v as usize * self.width as usize + u as usize])
    }
}

macro_rules! image_accessors {
    ($pixel:ty) => {
        /// Image width, pixels.
        #[must_use]
        pub fn width(&self) -> u32 {
            self.0.width
        }

        /// Image height, pixels.
        #[must_use]
        pub fn height(&self) -> u32 {
            self.0.height
        }

        /// Image width and height, pixels.
        #[must_use]
        pub fn size(&self) -> (u32, u32) {
            (self.0.width, self.0.height)
        }

        /// The pixels, row-major: index `v * width + u`.
        #[must_use]
        pub fn pixels(&self) -> &[$pixel] {
            &self.0.pixels
        }

        /// Returns the value at column `u`, row `v`, or `None` outside the image.
        #[must_use]
        #[inline]
        pub fn get(&self, u: u32, v: u32) -> Option<$pixel> {
            self.0.get(u, v)
        }
    };
}

pub(super) use image_accessors;
