//! What a mesh can cover.

use hicp_core::{Isometry3, PinholeCamera, PixelRegion, Point3};

use crate::projection::{Projection, effective_near};

/// How far rounding to the sub-pixel grid and in the projection can move an edge, generously, in
/// pixels.
const ROUNDING_MARGIN_PIXELS: f64 = 1.0e-5;

/// Where the vertices of a mesh project to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    u_min: f64,
    u_max: f64,
    v_min: f64,
    v_max: f64,
    cut: bool,
}

impl Bounds {
    /// The bounds of nothing.
    pub(crate) const EMPTY: Self = Self {
        u_min: f64::INFINITY,
        u_max: f64::NEG_INFINITY,
        v_min: f64::INFINITY,
        v_max: f64::NEG_INFINITY,
        cut: false,
    };

    /// Takes in a vertex beyond the near plane, at pixel (u, v).
    #[inline]
    pub(crate) fn include(&mut self, u: f64, v: f64) {
        // Not `f64::min`: a comparison is one instruction, and there is no NaN to look after.
        self.u_min = if u < self.u_min { u } else { self.u_min };
        self.u_max = if u > self.u_max { u } else { self.u_max };
        self.v_min = if v < self.v_min { v } else { self.v_min };
        self.v_max = if v > self.v_max { v } else { self.v_max };
    }

    /// Takes in a vertex in front of the near plane.
    #[inline]
    pub(crate) fn include_cut(&mut self) {
        self.cut = true;
    }

    /// Whether some vertex lies in front of the near plane.
    pub(crate) fn is_cut(&self) -> bool {
        self.cut
    }

    /// Returns the part of `region` that triangles over these vertices can cover, of area 0 in the
    /// default place if none.
    pub(crate) fn region_within(&self, region: &PixelRegion) -> PixelRegion {
        if self.u_min > self.u_max || region.is_empty() {
            return PixelRegion::default();
        }
        if self.cut {
            // Triangles that cross the near plane reach to places that no vertex projects to.
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

/// Converts to a pixel index; what lies outside saturates, and the intersection with the image does
/// the rest.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturation is what is wanted"
)]
fn to_pixel(x: f64) -> u32 {
    x as u32
}

/// Returns the part of `region` that the projection of some points, or of any triangles over them,
/// can cover.
///
/// Points are in metres in the object frame. `region` is cut to the image first. The result is the
/// bounding box of the projected points, in whole pixels whose centres it holds; all of `region` if
/// some points lie in front of the near plane (`near_meters` along the optical axis, as in
/// [`RasterConfig`](crate::RasterConfig)) and some beyond it; empty if all lie in front of it or
/// nothing projects into `region`.
///
/// [`Rasterizer`](crate::Rasterizer) resets its view to this region over all vertices of the mesh.
/// Cost: O(points).
///
/// ```
/// use hicp_core::{Isometry3, PinholeCamera, PixelRegion, Point3};
/// # fn main() -> Result<(), hicp_core::CameraError> {
/// let camera = PinholeCamera::new(100.0, 100.0, 50.0, 50.0, 101, 101)?;
/// let points = [Point3::new(-0.1, 0.0, 0.0), Point3::new(0.1, 0.05, 0.0)];
/// let region = hicp_raster::projected_region(
///     &points,
///     &camera,
///     &Isometry3::translation(0.0, 0.0, 1.0),
///     &camera.region(),
///     0.01,
/// );
/// assert_eq!(region, PixelRegion { u_min: 40, u_max: 61, v_min: 50, v_max: 56 });
/// # Ok(()) }
/// ```
#[must_use]
pub fn projected_region(
    points: &[Point3<f32>],
    camera: &PinholeCamera,
    camera_from_object: &Isometry3<f64>,
    region: &PixelRegion,
    near_meters: f64,
) -> PixelRegion {
    let Some(projection) = Projection::new(camera, camera_from_object) else {
        return PixelRegion::default();
    };
    let near = effective_near(near_meters);
    let mut bounds = Bounds::EMPTY;
    for point in points {
        let h = projection.homogeneous(point);
        if h.z >= near {
            let inverse_depth = 1.0 / h.z;
            bounds.include(h.x * inverse_depth, h.y * inverse_depth);
        } else {
            bounds.include_cut();
        }
    }
    bounds.region_within(&region.intersection(&camera.region()))
}
