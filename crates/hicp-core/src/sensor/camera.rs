//! The pinhole camera.

use nalgebra::{Matrix3, Point2, Point3};

use thiserror::Error;

use crate::internal::number::Number;
use crate::sensor::region::PixelRegion;

/// The position of the first pixel's center in the coordinates of a calibration.
///
/// The two conventions differ by half a pixel. Mixing them shifts every point by `depth / (2 f)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum PixelCenters {
    /// Pixel (0, 0) has its center at (0, 0): OpenCV calibrations, BOP's distance maps, this
    /// library.
    #[default]
    AtIntegers,
    /// Pixel (0, 0) has its center at (½, ½): OpenGL renderers and BlenderProc images.
    AtHalves,
}

/// A pinhole camera without distortion, looking along +z with x right and y down (the OpenCV
/// frame).
///
/// A point (x, y, z) in meters in the camera frame projects to u = fx·x/z + cx, v = fy·y/z + cy.
/// Pixel centers are at integers. Focal lengths and the principal point are in pixels.
///
/// ```
/// use hicp_core::{PinholeCamera, Point3};
/// # fn main() -> Result<(), hicp_core::CameraError> {
/// let camera = PinholeCamera::new(600.0, 600.0, 319.5, 239.5, 640, 480)?;
/// let pixel = camera.project(&Point3::new(0.1, 0.0, 0.5)).ok_or("behind the camera").unwrap();
/// assert!((pixel.x - 439.5).abs() < 1e-9);
/// # Ok(()) }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Unchecked"))]
pub struct PinholeCamera {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: u32,
    height: u32,
}

/// The fields of a serialized camera, before they are checked.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Unchecked {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: u32,
    height: u32,
}

#[cfg(feature = "serde")]
impl TryFrom<Unchecked> for PinholeCamera {
    type Error = CameraError;

    fn try_from(c: Unchecked) -> Result<Self, CameraError> {
        Self::new(c.fx, c.fy, c.cx, c.cy, c.width, c.height)
    }
}

/// The largest image side accepted, in pixels.
pub const MAX_IMAGE_SIDE: u32 = 32_768;

/// The longest accepted focal length and the largest accepted principal point coordinate, in
/// pixels.
///
/// A thousand times the values of any lens, and small enough that no pixel coordinate of a readable
/// mesh overflows.
pub const MAX_FOCAL_LENGTH: f64 = 1e9;

/// The shortest accepted focal length, in pixels. Below it, the whole scene falls into one pixel.
pub const MIN_FOCAL_LENGTH: f64 = 1e-3;

impl PinholeCamera {
    /// Creates a camera whose pixel centers are at integers. All lengths are in pixels.
    ///
    /// # Errors
    ///
    /// [`CameraError`] names the value outside of its range:
    ///
    /// - A focal length must be within [`MIN_FOCAL_LENGTH`] and [`MAX_FOCAL_LENGTH`].
    /// - A coordinate of the principal point must be within ±[`MAX_FOCAL_LENGTH`].
    /// - A side of the image must be within 1 and [`MAX_IMAGE_SIDE`].
    pub fn new(
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        width: u32,
        height: u32,
    ) -> Result<Self, CameraError> {
        for (name, value) in [("fx", fx), ("fy", fy)] {
            if !(MIN_FOCAL_LENGTH..=MAX_FOCAL_LENGTH).contains(&value) {
                return Err(CameraError::FocalLength { name, value });
            }
        }
        for (name, value) in [("cx", cx), ("cy", cy)] {
            if value.is_nan() || value.abs() > MAX_FOCAL_LENGTH {
                return Err(CameraError::PrincipalPoint { name, value });
            }
        }
        for (name, value) in [("width", width), ("height", height)] {
            if value == 0 || value > MAX_IMAGE_SIDE {
                return Err(CameraError::ImageSide { name, value });
            }
        }
        Ok(Self {
            fx,
            fy,
            cx,
            cy,
            width,
            height,
        })
    }

    /// Creates a camera from a calibration that states where its pixel centers lie.
    ///
    /// The principal point is converted here, once; the camera itself has its pixel centers at
    /// integers.
    ///
    /// # Errors
    ///
    /// As for [`PinholeCamera::new`].
    #[allow(clippy::too_many_arguments)]
    pub fn with_pixel_centers(
        centers: PixelCenters,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        width: u32,
        height: u32,
    ) -> Result<Self, CameraError> {
        let shift = match centers {
            PixelCenters::AtIntegers => 0.0,
            PixelCenters::AtHalves => 0.5,
        };
        Self::new(fx, fy, cx - shift, cy - shift, width, height)
    }

    /// Creates a camera from a calibration matrix K = [fx 0 cx; 0 fy cy; 0 0 1].
    ///
    /// # Errors
    ///
    /// As for [`PinholeCamera::new`]. Also if an entry of K that should be 0 or 1 differs by more
    /// than 1e-6.
    pub fn from_matrix(k: &Matrix3<f64>, width: u32, height: u32) -> Result<Self, CameraError> {
        for (row, column, expected) in [
            (0, 1, 0.0),
            (1, 0, 0.0),
            (2, 0, 0.0),
            (2, 1, 0.0),
            (2, 2, 1.0),
        ] {
            let found = k[(row, column)];
            if found.is_nan() || (found - expected).abs() > 1e-6 {
                return Err(CameraError::MatrixEntry {
                    row,
                    column,
                    found,
                    expected,
                });
            }
        }
        Self::new(k[(0, 0)], k[(1, 1)], k[(0, 2)], k[(1, 2)], width, height)
    }

    /// Returns a camera of lower resolution, for every `factor`-th pixel.
    ///
    /// Its pixel (i, j) has the ray of this camera's pixel (i·factor, j·factor). A factor of 0
    /// counts as 1.
    #[must_use]
    pub fn scaled_down(&self, factor: u32) -> Self {
        let factor = factor.max(1);
        let scale = 1.0 / f64::from(factor);
        Self {
            fx: self.fx * scale,
            fy: self.fy * scale,
            cx: self.cx * scale,
            cy: self.cy * scale,
            width: self.width.div_ceil(factor),
            height: self.height.div_ceil(factor),
        }
    }

    /// Horizontal focal length, pixels.
    #[must_use]
    pub fn fx(&self) -> f64 {
        self.fx
    }

    /// Vertical focal length, pixels.
    #[must_use]
    pub fn fy(&self) -> f64 {
        self.fy
    }

    /// Column of the principal point, pixels, with pixel centers at integers.
    #[must_use]
    pub fn cx(&self) -> f64 {
        self.cx
    }

    /// Row of the principal point, pixels, with pixel centers at integers.
    #[must_use]
    pub fn cy(&self) -> f64 {
        self.cy
    }

    /// Image width, pixels.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Image height, pixels.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Image width and height, pixels.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns the region of the whole image, pixels.
    #[must_use]
    pub fn region(&self) -> PixelRegion {
        PixelRegion::of_image(self.width, self.height)
    }

    /// Returns the image position of a point, in pixels, or `None` if the point is not in front.
    ///
    /// The point is in the camera frame, in meters. The position may lie outside the image.
    #[must_use]
    #[inline]
    pub fn project(&self, point: &Point3<f64>) -> Option<Point2<f64>> {
        (point.z > 0.0).then(|| {
            Point2::new(
                self.fx * point.x / point.z + self.cx,
                self.fy * point.y / point.z + self.cy,
            )
        })
    }

    /// Returns the point seen at pixel (u, v) at `depth`, in the camera frame.
    ///
    /// The depth is along the optical axis. The point has the unit of the depth, meters inside this
    /// library.
    #[must_use]
    #[inline]
    pub fn unproject(&self, u: f64, v: f64, depth: f64) -> Point3<f64> {
        Point3::new(
            (u - self.cx) / self.fx * depth,
            (v - self.cy) / self.fy * depth,
            depth,
        )
    }

    /// Returns distance / depth at a pixel: √(((u−cx)/fx)² + ((v−cy)/fy)² + 1).
    #[must_use]
    pub fn distance_per_depth(&self, u: f64, v: f64) -> f64 {
        let (x, y) = ((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        (x * x + y * y + 1.0).sqrt()
    }
}

/// The reason why values do not describe a camera.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CameraError {
    /// A focal length is not positive or outside the accepted range.
    #[error(
        "focal length {name} is {}, expected {} to {} pixels",
        Number(*value),
        MIN_FOCAL_LENGTH,
        MAX_FOCAL_LENGTH
    )]
    FocalLength {
        /// `fx` or `fy`.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// A coordinate of the principal point is far outside any image.
    #[error(
        "principal point {name} is {}, expected a number of pixels between -{1} and {1}",
        Number(*value),
        MAX_FOCAL_LENGTH
    )]
    PrincipalPoint {
        /// `cx` or `cy`.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// An image side is zero or too large.
    #[error("image {name} is {value} pixels, expected 1 to {}", MAX_IMAGE_SIDE)]
    ImageSide {
        /// `width` or `height`.
        name: &'static str,
        /// The value given.
        value: u32,
    },
    /// A calibration matrix does not have the form [fx 0 cx; 0 fy cy; 0 0 1].
    #[error(
        "camera matrix entry [{row}][{column}] is {}, expected {expected}: K must be [fx 0 cx; 0 fy cy; 0 0 1]",
        Number(*found)
    )]
    MatrixEntry {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        column: usize,
        /// The value given.
        found: f64,
        /// The value required.
        expected: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_print_large_numbers_in_short_form() {
        let error = CameraError::PrincipalPoint {
            name: "cx",
            value: 2e300,
        };
        assert_eq!(
            error.to_string(),
            "principal point cx is 2e300, expected a number of pixels between -1000000000 and 1000000000"
        );
    }
}
