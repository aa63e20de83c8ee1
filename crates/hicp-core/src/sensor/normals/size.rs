//! The size of the windows that normals are fitted over.

use crate::sensor::image::ImageError;

/// Largest standard error of the slope (tangent of the tilt) that the choice of the window accepts.
// Open: accuracy of the normals of C: §III-A. It chooses the window: a standard error of about 6°
// for a frontal surface.
const SLOPE_ERROR: f64 = 0.1;
/// Smallest and largest half side that the choice of the window considers, pixels.
// Open: window of the normals of C: §III-A. It follows the noise, since normals decide the
// robustness to depth noise (§VI-B.2): with 3 × 3 pixels, projective point-to-plane worsens at 1 %
// noise, and with these windows it does not. `NormalWindow` fixes the window.
const RADIUS: std::ops::RangeInclusive<usize> = 2..=10;
/// Half side of the windows near depth edges, pixels. Their rows must fit a byte.
pub(super) const EDGE_RADIUS: usize = 3;

/// The window of pixels that the normals of an [`Observation`](crate::Observation) are fitted over.
///
/// A larger window averages more noise and more curvature. Near depth edges, windows are at most
/// 7 × 7 pixels and use only the pixels on their own side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum NormalWindow {
    /// The smallest half side from 2 to 10 pixels that bounds the error of normals.
    ///
    /// The bound is a standard error of 0.1 of the surface's slope, given the image's noise. The
    /// noise is estimated from the median second difference of depth.
    #[default]
    Automatic,
    /// A fixed half side of 1 to 10 pixels, whatever the noise: `r` means 2 r + 1 pixels a side.
    ///
    /// `HalfSide(1)` is 3 × 3 pixels, the least smoothing. Such normals are about as noisy as
    /// central differences of the raw depth.
    HalfSide(u8),
}

impl NormalWindow {
    /// Checks that a fixed half side is from 1 to 10 pixels.
    pub(crate) fn check(self) -> Result<(), ImageError> {
        match self {
            Self::HalfSide(found) if !(1..=*RADIUS.end()).contains(&found.into()) => {
                Err(ImageError::NormalWindow { found })
            }
            _ => Ok(()),
        }
    }

    /// Returns the half sides away from depth edges and near them, pixels.
    ///
    /// The noise of the slope is that of one step between adjacent pixels.
    pub(super) fn radii(self, slope_noise_per_pixel: f64) -> (usize, usize) {
        match self {
            Self::Automatic => (smallest_accurate(slope_noise_per_pixel), EDGE_RADIUS),
            Self::HalfSide(radius) => (radius.into(), EDGE_RADIUS.min(radius.into())),
        }
    }
}

/// Returns the smallest half side at which the slope's standard error, noise/√Σu², is within
/// [`SLOPE_ERROR`].
fn smallest_accurate(slope_noise_per_pixel: f64) -> usize {
    let needed = (slope_noise_per_pixel / SLOPE_ERROR).powi(2);
    RADIUS
        .clone()
        .find(|r| {
            let (side, r) = ((2 * r + 1) as f64, *r as f64);
            // Σu² over a full (2r+1)² window.
            side * side * r * (r + 1.0) / 3.0 >= needed
        })
        .unwrap_or(*RADIUS.end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_is_the_smallest_with_an_accurate_slope() {
        // Σu² over a full window, pixel by pixel.
        let squares = |r: i32| -> f64 {
            let row: i32 = (-r..=r).map(|u| u * u).sum();
            f64::from((2 * r + 1) * row)
        };
        assert_eq!(smallest_accurate(0.0), 2);
        assert_eq!(smallest_accurate(f64::INFINITY), 10);
        for r in 2..=10_u8 {
            // The noise at which the standard error equals the limit.
            let noise = SLOPE_ERROR * squares(r.into()).sqrt();
            let r = usize::from(r);
            assert_eq!(smallest_accurate(noise * (1.0 - 1e-9)), r);
            assert_eq!(smallest_accurate(noise * (1.0 + 1e-9)), (r + 1).min(10));
        }
    }
}
