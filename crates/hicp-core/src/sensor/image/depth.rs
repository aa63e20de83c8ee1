//! Images of depths along the optical axis, and of distances from the camera.

use crate::sensor::camera::PinholeCamera;
use crate::sensor::image::error::{ImageError, check_size};
use crate::sensor::image::raster::{Raster, image_accessors};

/// Smallest depth that counts as measured, meters. The inverse of a smaller one is not accurate in
/// `f32`.
pub const MIN_DEPTH_METERS: f32 = 1e-6;

/// Largest depth that counts as measured, meters.
///
/// Depth cameras do not reach it, and squares of larger depths overflow.
pub const MAX_DEPTH_METERS: f32 = 1000.0;

/// An image of depths along the optical axis (z), in meters; 0 where nothing was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage(Raster<f32>);

impl DepthImage {
    /// Creates a depth image from depths in meters, row by row.
    ///
    /// Values that are not finite, below [`MIN_DEPTH_METERS`], or above [`MAX_DEPTH_METERS`] are
    /// stored as 0, which means missing.
    ///
    /// # Errors
    ///
    /// [`ImageError::PixelCount`] if `meters` does not hold `width * height` values.
    pub fn from_meters(width: u32, height: u32, mut meters: Vec<f32>) -> Result<Self, ImageError> {
        for z in &mut meters {
            *z = measured(*z);
        }
        Raster::new(width, height, meters).map(Self)
    }

    /// Creates a depth image from an iterator over depths in meters, row by row, in a single pass.
    ///
    /// The result is that of [`DepthImage::from_meters`]. Use it for depths that must be copied or
    /// converted anyway.
    ///
    /// # Errors
    ///
    /// [`ImageError::PixelCount`] if there are not `width * height` values.
    pub fn collect(
        width: u32,
        height: u32,
        meters: impl IntoIterator<Item = f32>,
    ) -> Result<Self, ImageError> {
        let pixels = meters.into_iter().map(measured).collect();
        Raster::new(width, height, pixels).map(Self)
    }

    /// The largest 16-bit unit. Sensors write it where they measured nothing, or too far away.
    pub const SATURATED: u16 = u16::MAX;

    /// Creates a depth image from the 16-bit units of a sensor, row by row.
    ///
    /// 0 and [`SATURATED`](Self::SATURATED) mean missing.
    ///
    /// `meters_per_unit` is the value of one unit: 0.001 for millimeters, BOP's `depth_scale`
    /// divided by 1000.
    ///
    /// # Errors
    ///
    /// [`ImageError::PixelCount`] if `units` does not hold `width * height` values.
    ///
    /// ```
    /// # fn main() -> Result<(), hicp_core::ImageError> {
    /// let depth = hicp_core::DepthImage::from_u16(3, 1, &[0, 1500, 65535], 0.001)?;
    /// assert_eq!(depth.pixels(), [0.0, 1.5, 0.0]);
    /// # Ok(()) }
    /// ```
    pub fn from_u16(
        width: u32,
        height: u32,
        units: &[u16],
        meters_per_unit: f64,
    ) -> Result<Self, ImageError> {
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
        let meters = units.iter().map(|z| match *z {
            Self::SATURATED => 0.0,
            z => (f64::from(z) * meters_per_unit) as f32,
        });
        Self::collect(width, height, meters)
    }

    image_accessors!(f32);

    /// Returns the image of every `factor`-th pixel of every `factor`-th row, from pixel (0, 0).
    ///
    /// A factor of 0 counts as 1.
    #[must_use]
    pub fn decimated(&self, factor: u32) -> Self {
        let factor = factor.max(1);
        let (width, height) = (
            self.width().div_ceil(factor),
            self.height().div_ceil(factor),
        );
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for row in self
            .pixels()
            .chunks_exact(self.width().max(1) as usize)
            .step_by(factor as usize)
        {
            pixels.extend(row.iter().step_by(factor as usize));
        }
        Self(Raster {
            width,
            height,
            pixels,
        })
    }

    /// Returns the distance image: the range along each pixel's ray instead of the depth, in
    /// meters.
    ///
    /// # Errors
    ///
    /// [`ImageError::SizeMismatch`] if the camera has a different size.
    pub fn to_distance(&self, camera: &PinholeCamera) -> Result<DistanceImage, ImageError> {
        check_size("depth image", self.size(), "camera", camera.size())?;
        let pixels = camera.region().pixels().zip(self.pixels());
        let distances = pixels.map(|((u, v), z)| {
            f64::from(*z) * camera.distance_per_depth(f64::from(u), f64::from(v))
        });
        DistanceImage::new(self.width(), self.height(), distances.collect())
    }
}

/// Returns the depth if it counts as measured, otherwise 0.
#[inline]
fn measured(z: f32) -> f32 {
    if (MIN_DEPTH_METERS..=MAX_DEPTH_METERS).contains(&z) {
        z
    } else {
        0.0
    }
}

/// An image of distances from the camera center (ranges); 0 where nothing was measured.
///
/// Distances are in meters unless their source states another unit. VSD and MVE compare distances,
/// not depths (§III-B).
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceImage(Raster<f64>);

impl DistanceImage {
    /// Creates a distance image, row by row.
    ///
    /// # Errors
    ///
    /// [`ImageError::PixelCount`] if `distances` does not hold `width * height` values.
    pub fn new(width: u32, height: u32, distances: Vec<f64>) -> Result<Self, ImageError> {
        Raster::new(width, height, distances).map(Self)
    }

    image_accessors!(f64);
}
