//! Lens distortion, removed from images when they are read.

use hicp_core::{ColorImage, DepthImage, Mask, PinholeCamera, PixelRegion};

use serde_json::Value;

use crate::number::whole;

/// The keys of coefficients that a file states one by one, in OpenCV's order.
pub(super) const COEFFICIENTS: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];

/// Returns whether a member holds coefficients of a distortion: a list or an object under any of
/// the names that programs use.
pub(super) fn is_distortion(key: &str, value: &Value) -> bool {
    let name = key.to_lowercase().replace('_', "");
    let is_known = matches!(&*name, "d" | "coeffs" | "dist" | "kc")
        || name.starts_with("distortion")
        || name.starts_with("distcoef");
    let is_stated = match value {
        Value::Array(items) => !items.is_empty(),
        value => value.is_object(),
    };
    is_known && is_stated
}

/// A lens distortion: maps a point of the ideal image plane to its place in the real image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// Brown–Conrady with k1, k2, p1, p2, k3, k4, k5, k6 in OpenCV's order, `plumb_bob` and
    /// `rational_polynomial` in ROS. The last three are 0 in the model of five parameters.
    BrownConrady([f64; 8]),
    /// Kannala–Brandt with k1 to k4, OpenCV's `fisheye` and `equidistant` in ROS.
    KannalaBrandt([f64; 4]),
}

impl Distortion {
    /// Moves a point of the plane at depth 1 to its place in the real image, both divided by z.
    #[must_use]
    pub fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let r2 = x * x + y * y;
        match self {
            Self::BrownConrady([k1, k2, p1, p2, k3, k4, k5, k6]) => {
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let radial = above / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
                [
                    x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                ]
            }
            Self::KannalaBrandt([k1, k2, k3, k4]) => {
                let r = r2.sqrt();
                let angle = r.atan();
                let a2 = angle * angle;
                let bent = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
                let factor = if r < 1e-12 { 1.0 } else { bent / r };
                [x * factor, y * factor]
            }
        }
    }

    /// Removes the distortion from a depth image of `camera`, with the nearest pixel.
    ///
    /// Depth is along the optical axis, so its values stay. A pixel that the real image does not
    /// show becomes missing.
    #[must_use]
    pub fn undistort_depth(&self, camera: &PinholeCamera, depth: &DepthImage) -> DepthImage {
        let (width, height) = depth.size();
        let pixels = self.moved(camera, (width, height), |u, v| depth.get(u, v));
        DepthImage::collect(width, height, pixels).unwrap_or_else(|_| depth.clone())
    }

    /// Removes the distortion from a mask of `camera`, with the nearest pixel.
    ///
    /// A pixel that the real image does not show becomes background.
    #[must_use]
    pub fn undistort_mask(&self, camera: &PinholeCamera, mask: &Mask) -> Mask {
        let (width, height) = mask.size();
        let pixels = self.moved(camera, (width, height), |u, v| mask.get(u, v));
        Mask::new(width, height, pixels.collect()).unwrap_or_else(|_| mask.clone())
    }

    /// Removes the distortion from a color image of `camera`, with the nearest pixel.
    ///
    /// A pixel that the real image does not show becomes black.
    #[must_use]
    pub fn undistort_color(&self, camera: &PinholeCamera, color: &ColorImage) -> ColorImage {
        let (width, height) = color.size();
        let pixels = self.moved(camera, (width, height), |u, v| color.get(u, v));
        ColorImage::new(width, height, pixels.collect()).unwrap_or_else(|_| color.clone())
    }

    /// Returns the nearest pixel of the real image for each pixel of the ideal one, row by row.
    ///
    /// A pixel that the real image does not show has the default value.
    fn moved<T: Default>(
        &self,
        camera: &PinholeCamera,
        (width, height): (u32, u32),
        get: impl Fn(u32, u32) -> Option<T>,
    ) -> impl Iterator<Item = T> {
        let (fx, fy, cx, cy) = (camera.fx(), camera.fy(), camera.cx(), camera.cy());
        PixelRegion::of_image(width, height)
            .pixels()
            .map(move |(u, v)| {
                let ideal = [(f64::from(u) - cx) / fx, (f64::from(v) - cy) / fy];
                let [x, y] = self.distort(ideal);
                let (u, v) = ((x * fx + cx).round(), (y * fy + cy).round());
                let inside = u >= 0.0 && v >= 0.0 && u < width.into() && v < height.into();
                let pixel = inside.then(|| get(whole(u), whole(v)));
                pixel.flatten().unwrap_or_default()
            })
    }
}
