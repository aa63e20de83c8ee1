//! Masks: the pixels that belong to an object.

use crate::sensor::image::depth::DepthImage;
use crate::sensor::image::error::ImageError;
use crate::sensor::image::raster::{Raster, image_accessors};
use crate::sensor::region::PixelRegion;

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
