//! The depth patch from which normals are estimated.

use crate::sensor::camera::PinholeCamera;
use crate::sensor::region::PixelRegion;

/// Depths below this limit, in meters, have no normal.
///
/// In the sums of a window, the rounding errors of their large inverses would exceed the inverse
/// depths of the other pixels.
pub(super) const MIN_DEPTH_METERS: f32 = 1e-4;

/// Depth inside a region in meters, row-major. Unused pixels are 0.
pub(crate) struct DepthPatch<'a> {
    pub(crate) region: PixelRegion,
    pub(crate) camera: &'a PinholeCamera,
    pub(crate) depth: &'a [f32],
}

impl DepthPatch<'_> {
    /// Returns the pixels of row `v` of the region.
    pub(super) fn row(&self, v: usize) -> &[f32] {
        let width = self.region.width();
        &self.depth[v * width..(v + 1) * width]
    }
}
