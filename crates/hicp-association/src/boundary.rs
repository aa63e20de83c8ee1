//! The boundary of a surface in a depth image.

use std::sync::Arc;

use hicp_core::{Observation, PinholeCamera, PixelRegion};

/// The largest effective width, pixels.
const MAX_WIDTH: u32 = 64;

/// The definition of the boundary of a surface in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BoundaryRule {
    width: u32,
    /// Largest difference in depth between neighboring pixels of one surface, as a fraction of the
    /// depth.
    max_step: f32,
}

impl BoundaryRule {
    /// Creates the rule for the images of a camera.
    ///
    /// The depth of a tilted surface on the optical axis changes by tan(tilt)/f of its value from
    /// one pixel to the next. f is the smaller focal length in pixels.
    pub(crate) fn new(width: u32, max_tilt_degrees: f64, camera: &PinholeCamera) -> Self {
        let focal = camera.fx().min(camera.fy());
        #[allow(clippy::cast_possible_truncation)]
        // A relative step; f32 is the precision of depth.
        let max_step = if max_tilt_degrees >= 90.0 {
            f32::INFINITY
        } else {
            (max_tilt_degrees.to_radians().tan() / focal) as f32
        };
        Self { width, max_step }
    }

    /// Returns whether pixel (u, v) of an image lies at a boundary.
    ///
    /// It does if it shows no surface (`depth_at` returns 0 or less). It also does if a pixel at a
    /// chessboard distance of r ≤ width shows no surface, or one whose depth differs by more than
    /// r·max_step of the nearer depth. Pixels outside `image` are ignored.
    pub(crate) fn holds(
        &self,
        u: u32,
        v: u32,
        image: &PixelRegion,
        depth_at: impl Fn(u32, u32) -> f32,
    ) -> bool {
        let width = self.width.min(MAX_WIDTH);
        let depth = depth_at(u, v);
        let columns = u.saturating_sub(width).max(image.u_min)..(u + width + 1).min(image.u_max);
        let mut rows = v.saturating_sub(width).max(image.v_min)..(v + width + 1).min(image.v_max);
        let continues = |x: u32, y: u32| {
            let other = depth_at(x, y);
            let reach = x.abs_diff(u).max(y.abs_diff(v)) as f32;
            let gate = self.max_step * reach * depth.min(other);
            // The pixel itself is not a step, and a NaN gate is one.
            other > 0.0 && (reach == 0.0 || (other - depth).abs() <= gate)
        };
        !(depth > 0.0 && rows.all(|y| columns.clone().all(|x| continues(x, y))))
    }
}

/// The pixels of an observation's region that lie at a boundary.
///
/// Built once per observation and rule, and shared by all threads.
pub(crate) struct BoundaryMap {
    at_boundary: Vec<bool>,
}

impl BoundaryMap {
    pub(crate) fn of(observation: &Observation, rule: BoundaryRule) -> Arc<Self> {
        let key = u64::from(rule.width.min(MAX_WIDTH)) << 32 | u64::from(rule.max_step.to_bits());
        observation.derived().get_or_build(key, || {
            let (mask, depth) = (observation.mask(), observation.depth());
            let (region, image) = (observation.region(), observation.camera().region());
            let depth_at = |u, v| {
                let masked = mask.get(u, v) == Some(true);
                depth.get(u, v).filter(|_| masked).unwrap_or(0.0)
            };
            let width = rule.width.min(MAX_WIDTH);
            // The measurement ends at the border of the image.
            let beside_border = |u: u32, v: u32| {
                u < width || v < width || u + width >= image.u_max || v + width >= image.v_max
            };
            let at_boundary = region
                .pixels()
                .map(|(u, v)| beside_border(u, v) || rule.holds(u, v, &image, depth_at))
                .collect();
            Self { at_boundary }
        })
    }

    /// Returns whether the surfel of an index lies at a boundary; true for an invalid index.
    pub(crate) fn contains(&self, target_index: u32) -> bool {
        self.at_boundary
            .get(target_index as usize)
            .copied()
            .unwrap_or(true)
    }
}
