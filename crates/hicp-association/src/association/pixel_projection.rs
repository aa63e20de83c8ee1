//! Projection of many points into pixels.

use hicp_core::{PinholeCamera, Point3};

/// A pinhole camera in `f32`, with a resolution of 1e-3 pixels in any accepted image.
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

    /// Returns the image position (u, v) of a point.
    ///
    /// Returns `None` for a point at or behind the camera plane, and for one that overflowed `f32`
    /// and would fall on the principal point.
    #[inline]
    pub(crate) fn project(&self, point: &Point3<f32>) -> Option<(f32, f32)> {
        (point.z > 0.0 && point.z.is_finite()).then(|| {
            (
                self.fx * point.x / point.z + self.cx,
                self.fy * point.y / point.z + self.cy,
            )
        })
    }

    /// Returns the image positions of many points, given as one array per coordinate.
    ///
    /// They are meaningless if z is not positive and finite.
    #[inline(always)]
    pub(crate) fn project_all<const N: usize>(
        &self,
        points: &[[f32; N]; 3],
    ) -> ([f32; N], [f32; N]) {
        let (mut us, mut vs) = ([0.0; N], [0.0; N]);
        let [x, y, z] = points;
        for ((u, x), z) in us.iter_mut().zip(x).zip(z) {
            *u = self.fx * x / z + self.cx;
        }
        for ((v, y), z) in vs.iter_mut().zip(y).zip(z) {
            *v = self.fy * y / z + self.cy;
        }
        (us, vs)
    }

    /// Returns the point seen at (u, v) at a depth of `z` meters.
    #[inline]
    pub(crate) fn unproject(&self, u: f32, v: f32, z: f32) -> Point3<f32> {
        Point3::new((u - self.cx) / self.fx * z, (v - self.cy) / self.fy * z, z)
    }
}
