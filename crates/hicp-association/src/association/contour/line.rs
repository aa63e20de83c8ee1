//! The lines that cross the silhouette.

use hicp_core::{PinholeCamera, RenderedView, Vector3};

/// Number of steps to each side of the silhouette.
pub(super) const SIDE: usize = 10;
/// Number of pixels of a line.
pub(super) const LENGTH: usize = 2 * SIDE + 1;
/// Half side of the window in which the direction of the silhouette is measured, pixels.
const WINDOW: i32 = 3;
/// Shortest sum of offsets in the window that is a direction, pixels.
const LEAST_DIRECTION: f64 = 3.0;

/// A line of pixels across the silhouette, from inside to outside, and their evidence.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// The pixel of the silhouette, which is the middle of the line.
    pub(super) pixel: (u32, u32),
    /// One step along the line, pixels.
    pub(super) step: (f64, f64),
    /// The rendered point of that pixel in the camera frame, meters.
    pub(super) point: Vector3<f64>,
    /// The direction out of the silhouette, perpendicular to the ray.
    pub(super) normal: Vector3<f64>,
    /// Length of a step at the point's depth, meters.
    pub(super) step_meters: f64,
    /// The evidence of depth that each pixel shows the object: a logarithm of odds.
    pub(super) depth: [f64; LENGTH],
    /// 1 for pixels of the mask, −1 for others, and 0 for pixels that something hides.
    pub(super) mask: [f64; LENGTH],
}

impl Line {
    /// Creates the line across the silhouette at a pixel, with steps of `step` pixels.
    ///
    /// Returns `None` if the silhouette has no direction there.
    pub(super) fn across(
        view: &RenderedView,
        camera: &PinholeCamera,
        pixel: (u32, u32),
        step: f64,
    ) -> Option<Self> {
        let (x, y) = outward(view, pixel)?;
        let z = f64::from(view.depth_at(pixel.0, pixel.1));
        let (u, v) = (f64::from(pixel.0), f64::from(pixel.1));
        let point = camera.unproject(u, v, z).coords;
        // The gradient of the image position along the line, which is perpendicular to the ray.
        let (gx, gy) = (x * camera.fx() / z, y * camera.fy() / z);
        let gradient = Vector3::new(gx, gy, -(gx * point.x + gy * point.y) / z);
        let pixels_per_meter = gradient.norm();
        let finite = pixels_per_meter.is_finite() && pixels_per_meter > 0.0;
        finite.then(|| Self {
            pixel,
            step: (x * step, y * step),
            point,
            normal: gradient / pixels_per_meter,
            step_meters: step / pixels_per_meter,
            depth: [0.0; LENGTH],
            mask: [0.0; LENGTH],
        })
    }

    /// Returns the signed number of steps from the silhouette to a pixel of the line.
    pub(super) fn steps(index: usize) -> f64 {
        index as f64 - SIDE as f64
    }

    /// Returns a pixel of the line, or `None` outside of the image.
    pub(super) fn pixel_at(&self, index: usize, camera: &PinholeCamera) -> Option<(u32, u32)> {
        let steps = Self::steps(index);
        // The square of a pixel extends half a pixel around its integer center.
        let u = f64::from(self.pixel.0) + self.step.0 * steps + 0.5;
        let v = f64::from(self.pixel.1) + self.step.1 * steps + 0.5;
        let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
        let inside = (0.0..width).contains(&u) && (0.0..height).contains(&v);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // A pixel of the image.
        inside.then_some((u as u32, v as u32))
    }
}

/// Returns the direction out of the silhouette at one of its pixels, of length 1.
fn outward(view: &RenderedView, (u, v): (u32, u32)) -> Option<(f64, f64)> {
    let (mut x, mut y) = (0.0, 0.0);
    for dv in -WINDOW..=WINDOW {
        for du in -WINDOW..=WINDOW {
            let pixel = u.checked_add_signed(du).zip(v.checked_add_signed(dv));
            if pixel.is_some_and(|(u, v)| view.depth_at(u, v) > 0.0) {
                x -= f64::from(du);
                y -= f64::from(dv);
            }
        }
    }
    let length = f64::hypot(x, y);
    (length >= LEAST_DIRECTION).then(|| (x / length, y / length))
}
