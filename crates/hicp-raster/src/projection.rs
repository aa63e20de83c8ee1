//! The projection of vertices to pixels.

use glam::{DMat3, DVec3};
use hicp_core::{Isometry3, PinholeCamera, Point3};

use crate::fixed::{FixedPoint, GUARD_PIXELS};

/// Largest translation of a valid pose, meters.
///
/// Beyond it, depth would leave the range of `f32`.
const MAX_TRANSLATION_METERS: f64 = 1.0e30;

/// Default depth of the near plane, meters.
// Open: near plane of the renders: §III-B. Meters. Initial poses of the studies may reach through
// the camera.
pub const DEFAULT_NEAR_METERS: f64 = 0.01;

/// Smallest depth of the near plane, meters: 1/z must stay finite.
const MIN_NEAR_METERS: f64 = 1.0e-6;

/// Returns the near plane for a configured value.
pub(crate) fn effective_near(near_meters: f64) -> f64 {
    // `max` returns the other argument for NaN.
    near_meters.max(MIN_NEAR_METERS)
}

/// The map from object coordinates to homogeneous pixels (u·z, v·z, z).
///
/// It is K · `camera_from_object` as one affine map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projection {
    linear: DMat3,
    offset: DVec3,
}

impl Projection {
    /// Returns `None` for a pose that is not finite or too far away, which shows nothing.
    pub(crate) fn new(camera: &PinholeCamera, camera_from_object: &Isometry3<f64>) -> Option<Self> {
        let rotation = camera_from_object.rotation.to_rotation_matrix();
        let rotation = DMat3::from_cols_slice(rotation.matrix().as_slice());
        let t = &camera_from_object.translation.vector;
        let translation = DVec3::new(t.x, t.y, t.z);
        if !rotation.is_finite()
            || !translation.is_finite()
            || translation.abs().max_element() > MAX_TRANSLATION_METERS
        {
            return None;
        }
        let intrinsics = DMat3::from_cols(
            DVec3::new(camera.fx(), 0.0, 0.0),
            DVec3::new(0.0, camera.fy(), 0.0),
            DVec3::new(camera.cx(), camera.cy(), 1.0),
        );
        Some(Self {
            linear: intrinsics * rotation,
            offset: intrinsics * translation,
        })
    }

    /// Returns the homogeneous pixel (u·z, v·z, z) of a point in the object frame.
    #[inline]
    pub(crate) fn homogeneous(&self, point: &Point3<f32>) -> DVec3 {
        let p = DVec3::new(f64::from(point.x), f64::from(point.y), f64::from(point.z));
        self.linear * p + self.offset
    }
}

/// A vertex in the image, with the values that its triangles share.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ProjectedVertex {
    /// Column and row in pixels, not rounded, for the computation of depth.
    pub(crate) u: f64,
    pub(crate) v: f64,
    /// 1/z, 1/m. A value of 0 marks a vertex whose triangles must be clipped; its other fields are
    /// meaningless.
    pub(crate) inverse_depth: f64,
    /// Column and row on the sub-pixel grid, which decide coverage.
    pub(crate) fixed: FixedPoint,
}

impl ProjectedVertex {
    /// The replacement of a vertex in front of the near plane or outside the guard band.
    pub(crate) const TO_CLIP: Self = Self {
        u: 0.0,
        v: 0.0,
        inverse_depth: 0.0,
        fixed: FixedPoint { u: 0, v: 0 },
    };

    /// Creates the vertex at pixel (u, v).
    #[inline]
    pub(crate) fn new(u: f64, v: f64, inverse_depth: f64) -> Self {
        if u.abs() <= GUARD_PIXELS && v.abs() <= GUARD_PIXELS {
            Self {
                u,
                v,
                inverse_depth,
                fixed: FixedPoint::nearest(u, v),
            }
        } else {
            Self::TO_CLIP
        }
    }
}
