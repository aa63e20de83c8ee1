//! The depth patch from which normals are estimated.

use super::lanes::{LANES, Lanes, lanes};
use crate::internal::{VectorLoop, vectorized};
use crate::sensor::camera::PinholeCamera;
use crate::sensor::image::{DepthImage, Mask};
use crate::sensor::region::PixelRegion;

/// Depths below this limit, in meters, have no normal.
///
/// In the sums of a window, the rounding errors of their large inverses would exceed the inverse
/// depths of the other pixels.
pub(super) const MIN_FITTED_METERS: f32 = 1e-4;

/// Depth inside a mask's bounding box in meters, row-major. Unused pixels are 0.
pub(crate) struct DepthPatch<'a> {
    pub(crate) region: PixelRegion,
    pub(super) camera: &'a PinholeCamera,
    /// Followed by a block of zeros.
    depth: Vec<f32>,
}

impl<'a> DepthPatch<'a> {
    /// Copies the masked depths of an image.
    pub(crate) fn new(depth: &DepthImage, mask: &Mask, camera: &'a PinholeCamera) -> Self {
        let region = mask.bounding_region();
        let (width, image_width) = (region.width(), depth.width() as usize);
        let mut patch = vec![0.0; region.area() + LANES];
        let rows = patch[..region.area()].chunks_exact_mut(width.max(1));
        for (v, to) in (region.v_min as usize..).zip(rows) {
            let columns = v * image_width + region.u_min as usize..;
            vectorized(CopyMasked {
                depth: &depth.pixels()[columns.clone()],
                mask: &mask.pixels()[columns],
                to,
            });
        }
        Self {
            region,
            camera,
            depth: patch,
        }
    }

    /// Returns all pixels.
    pub(super) fn pixels(&self) -> &[f32] {
        &self.depth[..self.region.area()]
    }

    /// Returns the pixels of row `v` of the region.
    pub(super) fn row(&self, v: usize) -> &[f32] {
        let width = self.region.width();
        &self.depth[v * width..(v + 1) * width]
    }

    /// Returns the pixels of a block that starts at (u, v).
    ///
    /// Those beyond the end of the row are of the next row, or zeros.
    #[inline(always)]
    pub(super) fn block(&self, u: usize, v: usize) -> Lanes<f32> {
        lanes(&self.depth, v * self.region.width() + u)
    }
}

/// The loop that copies the masked pixels of a row.
struct CopyMasked<'a> {
    depth: &'a [f32],
    mask: &'a [bool],
    to: &'a mut [f32],
}

impl VectorLoop for CopyMasked<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for ((to, z), masked) in self.to.iter_mut().zip(self.depth).zip(self.mask) {
            *to = if *masked { *z } else { 0.0 };
        }
    }
}

/// Returns the number of masked pixels with depth.
pub(crate) fn n_measured(depth: &DepthImage, mask: &Mask) -> usize {
    let (region, image_width) = (mask.bounding_region(), depth.width() as usize);
    let (first, end) = (region.u_min as usize, region.u_max as usize);
    (region.v_min as usize..region.v_max as usize)
        .map(|v| v * image_width)
        .map(|row| {
            vectorized(CountMeasured {
                depth: &depth.pixels()[row + first..row + end],
                mask: &mask.pixels()[row + first..row + end],
            })
        })
        .sum()
}

/// The loop that counts the measured pixels of a row.
struct CountMeasured<'a> {
    depth: &'a [f32],
    mask: &'a [bool],
}

impl VectorLoop for CountMeasured<'_> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        // In 32 bits, more counters fit into a vector.
        let mut n_measured = 0_u32;
        for (z, masked) in self.depth.iter().zip(self.mask) {
            n_measured += u32::from(*masked & (*z > 0.0));
        }
        n_measured as usize
    }
}
