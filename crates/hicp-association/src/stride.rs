//! The density of a pixel grid.

/// The spacing of a pixel grid: fixed, or computed from the requested number of points.
///
/// In an image, accuracy hardly depends on it: with every fourth pixel in both directions, the VSD
/// after ICP was that of all pixels, in a fifth of the time. A cloud has no grid, and its points
/// can be in any order: thin it with [`voxel_downsample`](crate::voxel_downsample) instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stride {
    /// Every n-th pixel in both directions, or every n²-th point of a cloud. 0 counts as 1.
    Pixels(u32),
    /// The stride that gives about this many pixels, within a factor of two if there are enough.
    ///
    /// 0 counts as 1. For a cloud, all points are used.
    AboutPoints(usize),
}

impl Stride {
    /// Returns the spacing in pixels for a surface of `n_pixels` pixels.
    #[must_use]
    pub fn pixels(self, n_pixels: usize) -> u32 {
        match self {
            Self::Pixels(stride) => stride.max(1),
            Self::AboutPoints(points) => {
                let ratio = n_pixels as f64 / points.max(1) as f64;
                // The spacing s whose share 1/s² is nearest to 1/ratio, as a factor: s (s − 1) ≤
                // ratio < s (s + 1).
                let stride = ((1.0 + (1.0 + 4.0 * ratio).sqrt()) / 2.0).floor();
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                // At most √(2³²), not negative.
                let stride = stride as u32;
                stride.max(1)
            }
        }
    }
}
