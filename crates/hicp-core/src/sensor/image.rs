//! Depth images, distance images and masks, as separate types so that they cannot be swapped.
//!
//! All are row-major with index `v * width + u`. Lengths are in meters; 0 means that nothing was
//! measured.

use thiserror::Error;

use crate::sensor::camera::PinholeCamera;
use crate::sensor::region::PixelRegion;

/// Smallest depth that counts as measured, meters. The inverse of a smaller one is not accurate in
/// `f32`.
pub const MIN_DEPTH_METERS: f32 = 1e-6;

/// Largest depth that counts as measured, meters.
///
/// Depth cameras do not reach it, and squares of larger depths overflow.
pub const MAX_DEPTH_METERS: f32 = 1000.0;

/// A row-major image of any pixel type.
#[derive(Clone, Debug, PartialEq)]
struct Raster<T> {
    width: u32,
    height: u32,
    pixels: Vec<T>,
}

impl<T: Copy> Raster<T> {
    fn new(width: u32, height: u32, pixels: Vec<T>) -> Result<Self, ImageError> {
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

    fn get(&self, u: u32, v: u32) -> Option<T> {
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

/// The set of pixels that belong to the object.
///
/// Its bounding box is computed once, on creation.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask(Raster<bool>, PixelRegion);

impl Mask {
    /// Creates a mask, row by row.
    ///
    /// Cost: O(pixels), for the bounding box.
    ///
    /// # Errors
    ///
    /// [`ImageError::PixelCount`] if `pixels` does not hold `width * height` values.
    pub fn new(width: u32, height: u32, pixels: Vec<bool>) -> Result<Self, ImageError> {
        let raster = Raster::new(width, height, pixels)?;
        let region = bounding_region(&raster);
        Ok(Self(raster, region))
    }

    /// Creates a mask of the pixels of a bounding box: left and upper side, width and height.
    ///
    /// The box is in pixels, in the form of BOP and COCO. Its sides are rounded to pixels, and
    /// parts outside of the image are ignored. A number that is NaN may make it empty. Cost: as
    /// [`Mask::in_region`].
    ///
    /// # Panics
    ///
    /// As [`Mask::in_region`].
    ///
    /// ```
    /// use hicp_core::{Mask, PixelRegion};
    /// let mask = Mask::in_box(64, 48, [10.0, 20.2, 30.0, 99.0]);
    /// let region = PixelRegion { u_min: 10, v_min: 20, u_max: 40, v_max: 48 };
    /// assert_eq!((mask.bounding_region(), mask.n_set()), (region, 30 * 28));
    /// ```
    #[must_use]
    pub fn in_box(width: u32, height: u32, [x, y, w, h]: [f64; 4]) -> Self {
        // The cast saturates, and NaN becomes 0.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let pixel = |at: f64| at.round() as u32;
        let region = PixelRegion {
            u_min: pixel(x),
            v_min: pixel(y),
            u_max: pixel(x + w),
            v_max: pixel(y + h),
        };
        Self::in_region(width, height, &region, |_, _| true)
    }

    /// Creates a mask whose pixels outside of a region are not set.
    ///
    /// `is_set` returns whether pixel (u, v) of the region belongs to the object. Parts of the
    /// region outside of the image are ignored. Cost: that of zeroed memory for the image, and
    /// O(pixels of the region).
    ///
    /// # Panics
    ///
    /// If memory cannot hold `width * height` bytes. No camera has sides above
    /// [`MAX_IMAGE_SIDE`](crate::MAX_IMAGE_SIDE).
    ///
    /// ```
    /// use hicp_core::{Mask, PixelRegion};
    /// let region = PixelRegion { u_min: 1, v_min: 0, u_max: 9, v_max: 2 };
    /// let mask = Mask::in_region(4, 3, &region, |u, v| u != v);
    /// assert_eq!(mask.get(1, 1), Some(false));
    /// assert_eq!(mask.get(3, 1), Some(true));
    /// assert_eq!(mask.bounding_region(), PixelRegion { u_min: 1, v_min: 0, u_max: 4, v_max: 2 });
    /// ```
    #[must_use]
    pub fn in_region(
        width: u32,
        height: u32,
        region: &PixelRegion,
        mut is_set: impl FnMut(u32, u32) -> bool,
    ) -> Self {
        let mut pixels = vec![false; width as usize * height as usize];
        let region = region.intersection(&PixelRegion::of_image(width, height));
        let mut bounds: Option<PixelRegion> = None;
        for v in region.v_min..region.v_max {
            let start = v as usize * width as usize;
            for u in region.u_min..region.u_max {
                if !is_set(u, v) {
                    continue;
                }
                pixels[start + u as usize] = true;
                let found = bounds.get_or_insert(PixelRegion {
                    u_min: u,
                    v_min: v,
                    u_max: u,
                    v_max: v,
                });
                found.u_min = found.u_min.min(u);
                found.u_max = found.u_max.max(u + 1);
                found.v_max = v + 1;
            }
        }
        let raster = Raster {
            width,
            height,
            pixels,
        };
        Self(raster, bounds.unwrap_or_default())
    }

    /// Number of pixels that belong to the object. Cost: O(pixels).
    #[must_use]
    pub fn n_set(&self) -> usize {
        self.0.pixels.iter().filter(|set| **set).count()
    }

    /// Creates a mask from bytes, row by row: every pixel that is not 0 belongs to the object.
    ///
    /// # Errors
    ///
    /// [`ImageError::PixelCount`] if `pixels` does not hold `width * height` values.
    ///
    /// ```
    /// # fn main() -> Result<(), hicp_core::ImageError> {
    /// let mask = hicp_core::Mask::from_u8(3, 1, &[0, 1, 255])?;
    /// assert_eq!(mask.n_set(), 2);
    /// # Ok(()) }
    /// ```
    pub fn from_u8(width: u32, height: u32, pixels: &[u8]) -> Result<Self, ImageError> {
        Self::new(width, height, pixels.iter().map(|p| *p != 0).collect())
    }

    /// Creates the mask of the pixels that have a depth, such as the silhouette of a render.
    #[must_use]
    pub fn measured(depth: &DepthImage) -> Self {
        let (width, height) = depth.size();
        let region = PixelRegion::of_image(width, height);
        let is_measured = |u, v| depth.get(u, v).is_some_and(|z| z > 0.0);
        Self::in_region(width, height, &region, is_measured)
    }

    /// Creates a mask in which every pixel belongs to the object.
    ///
    /// # Panics
    ///
    /// If memory cannot hold `width * height` bytes. No camera has sides above
    /// [`MAX_IMAGE_SIDE`](crate::MAX_IMAGE_SIDE).
    #[must_use]
    pub fn full(width: u32, height: u32) -> Self {
        let region = PixelRegion::of_image(width, height);
        Self::in_region(width, height, &region, |_, _| true)
    }

    image_accessors!(bool);

    /// Returns the smallest region that holds every set pixel; empty if no pixel is set.
    ///
    /// Cost: O(1), since it was computed on creation.
    #[must_use]
    pub fn bounding_region(&self) -> PixelRegion {
        self.1
    }
}

fn bounding_region(mask: &Raster<bool>) -> PixelRegion {
    let mut region = PixelRegion::default();
    if mask.width == 0 {
        return region;
    }
    for (row, v) in mask.pixels.chunks_exact(mask.width as usize).zip(0_u32..) {
        // Most rows are empty. Without an early exit, the compiler vectorizes the scan of a row.
        if !row.iter().fold(false, |any, set| any | set) {
            continue;
        }
        let set = |u: &u32| row[*u as usize];
        let first = (0..mask.width).find(set).unwrap_or(0);
        let last = (0..mask.width).rfind(set).unwrap_or(first);
        region = region.union(&PixelRegion {
            u_min: first,
            v_min: v,
            u_max: last + 1,
            v_max: v + 1,
        });
    }
    region
}

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
