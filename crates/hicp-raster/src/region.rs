//! The part of an image that a mesh can cover.

use hicp_core::PixelRegion;

/// Upper limit, in pixels, of the shift of an edge by rounding in projection and sub-pixel grid.
const ROUNDING_MARGIN_PIXELS: f64 = 1.0e-5;

/// The bounding box of the projected vertices of a mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    u_min: f64,
    u_max: f64,
    v_min: f64,
    v_max: f64,
    /// `true` if a vertex lies in front of the near plane.
    pub(crate) cut: bool,
}

impl Bounds {
    /// The bounds of no vertices.
    pub(crate) const EMPTY: Self = Self {
        u_min: f64::INFINITY,
        u_max: f64::NEG_INFINITY,
        v_min: f64::INFINITY,
        v_max: f64::NEG_INFINITY,
        cut: false,
    };

    /// Extends the bounds by a vertex beyond the near plane, at pixel (u, v).
    #[inline]
    pub(crate) fn include(&mut self, u: f64, v: f64) {
        // Not `f64::min`: a comparison is one instruction, and NaN cannot occur.
        self.u_min = if u < self.u_min { u } else { self.u_min };
        self.u_max = if u > self.u_max { u } else { self.u_max };
        self.v_min = if v < self.v_min { v } else { self.v_min };
        self.v_max = if v > self.v_max { v } else { self.v_max };
    }

    /// Returns the part of `region` that triangles over these vertices can cover.
    ///
    /// If there is none, returns the default region, which is empty.
    pub(crate) fn region_within(&self, region: &PixelRegion) -> PixelRegion {
        if self.u_min > self.u_max || region.is_empty() {
            return PixelRegion::default();
        }
        if self.cut {
            // Triangles that cross the near plane reach places that no vertex projects to.
            return *region;
        }
        let covered = PixelRegion {
            u_min: to_pixel((self.u_min - ROUNDING_MARGIN_PIXELS).ceil()),
            u_max: to_pixel((self.u_max + ROUNDING_MARGIN_PIXELS).floor() + 1.0),
            v_min: to_pixel((self.v_min - ROUNDING_MARGIN_PIXELS).ceil()),
            v_max: to_pixel((self.v_max + ROUNDING_MARGIN_PIXELS).floor() + 1.0),
        };
        let covered = covered.intersection(region);
        if covered.is_empty() {
            PixelRegion::default()
        } else {
            covered
        }
    }
}

/// Converts to a pixel index. Values outside saturate, and the intersection with the image clips
/// them.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturation is intended"
)]
fn to_pixel(x: f64) -> u32 {
    x as u32
}
