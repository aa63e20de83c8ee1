//! Projection of many points into pixels.

use hicp_core::{PinholeCamera, Point3};

/// A pinhole camera in `f32`, which resolves 1e-3 of a pixel in any accepted image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelProjection {
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
}

impl PixelProjection {
    pub(crate) fn new(camera: &PinholeCamera) -> Self {
        #[allow(clippy::cast_possible_truncation)]
        let [fx, fy, cx, cy] =
            [camera.fx(), camera.fy(), camera.cx(), camera.cy()].map(|x| x as f32);
        Self { fx, fy, cx, cy }
    }

    /// Returns the image position (u, v) of a point; `None` for a point at or behind the camera plane, or infinitely far.
    #[inline]
    pub(crate) fn project(&self, point: &Point3<f32>) -> Option<(f32, f32)> {
        (point.z > 0.0 && point.z < f32::INFINITY).then(|| {
            (
                self.fx * point.x / point.z + self.cx,
                self.fy * point.y / point.z + self.cy,
            )
        })
    }

    /// Returns the point seen at (u, v) at a depth of `z` metres.
    #[inline]
    pub(crate) fn unproject(&self, u: f32, v: f32, z: f32) -> Point3<f32> {
        Point3::new((u - self.cx) / self.fx * z, (v - self.cy) / self.fy * z, z)
    }
}
