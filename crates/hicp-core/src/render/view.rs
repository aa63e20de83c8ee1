//! The buffer that renderers fill.

use nalgebra::{Isometry3, UnitVector3};

use crate::internal::{VectorLoop, vectorized};
use crate::object::mesh::TriMesh;
use crate::sensor::camera::PinholeCamera;
use crate::sensor::region::PixelRegion;
use crate::surfel::Surfel;

/// The triangle id of a pixel without a surface.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// A rendered region of an image: depth and visible triangle per pixel.
///
/// The caller owns and reuses it. Buffers are row-major over [`RenderedView::region`]. Depth is
/// along the optical axis in meters. A pixel without a surface has depth 0 and the triangle
/// [`NO_TRIANGLE`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderedView {
    region: PixelRegion,
    pub(super) depth: Vec<f32>,
    pub(super) triangles: Vec<u32>,
}

impl RenderedView {
    /// Clears the view and sets its region to `region`.
    ///
    /// Allocates only if the region is larger than any before.
    ///
    /// # Panics
    ///
    /// If memory cannot hold eight bytes per pixel. No camera has sides above
    /// [`MAX_IMAGE_SIDE`](crate::MAX_IMAGE_SIDE).
    pub fn reset(&mut self, region: PixelRegion) {
        self.region = region;
        self.depth.clear();
        self.depth.resize(region.area(), 0.0);
        self.triangles.clear();
        self.triangles.resize(region.area(), NO_TRIANGLE);
    }

    /// Copies another view into this one, reusing the memory.
    pub fn copy_from(&mut self, other: &Self) {
        self.region = other.region;
        self.depth.clone_from(&other.depth);
        self.triangles.clone_from(&other.triangles);
    }

    /// The region of the buffers, pixels.
    #[must_use]
    pub fn region(&self) -> PixelRegion {
        self.region
    }

    /// Depth along the optical axis, meters; 0 where there is no surface.
    #[must_use]
    pub fn depth(&self) -> &[f32] {
        &self.depth
    }

    /// Index of the visible triangle; [`NO_TRIANGLE`] where there is no surface.
    #[must_use]
    pub fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// The depth and triangle buffers, for the renderer that fills them.
    pub fn buffers_mut(&mut self) -> (&mut [f32], &mut [u32]) {
        (&mut self.depth, &mut self.triangles)
    }

    /// Number of pixels that show the surface.
    #[must_use]
    pub fn n_rendered(&self) -> usize {
        vectorized(CountRendered(&self.depth))
    }

    /// Returns the pixels of the image that show the surface, row by row.
    pub fn covered(&self) -> impl Iterator<Item = (u32, u32)> {
        let pixels = self.region.pixels().zip(&self.depth);
        pixels.filter_map(|(pixel, z)| (*z > 0.0).then_some(pixel))
    }

    /// Returns the depth at an image pixel, in meters.
    ///
    /// It is 0 if nothing was rendered there, and outside the region.
    #[must_use]
    #[inline]
    pub fn depth_at(&self, u: u32, v: u32) -> f32 {
        self.region.index(u, v).map_or(0.0, |i| self.depth[i])
    }

    /// Returns the rendered surface at an image pixel, in the camera frame with the normal facing
    /// the camera.
    ///
    /// Returns `None` if nothing was rendered there or `mesh` does not have the triangle. `mesh`,
    /// `camera` and `camera_from_object` must be those of the render.
    #[must_use]
    #[inline]
    pub fn surfel_at(
        &self,
        u: u32,
        v: u32,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
    ) -> Option<Surfel> {
        let (triangle, depth) = self.seen_at(u, v, mesh)?;
        let normal = mesh.normal(triangle)?;
        let point = camera.unproject(f64::from(u), f64::from(v), depth);
        let normal = camera_from_object.rotation * normal.cast::<f64>().into_inner();
        let facing = if normal.dot(&point.coords) > 0.0 {
            -normal
        } else {
            normal
        };
        Some(Surfel {
            point: point.cast::<f32>(),
            normal: UnitVector3::new_unchecked(facing.cast::<f32>()),
        })
    }

    /// Returns the color of the rendered surface at an image pixel: red, green and blue, 0 to 255.
    ///
    /// Returns `None` if nothing was rendered there, if the mesh has no color, or as for
    /// [`Self::surfel_at`]. The color is that at the pixel's center, without filtering. Cost: one
    /// intersection of a ray with a triangle.
    #[must_use]
    pub fn color_at(
        &self,
        u: u32,
        v: u32,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
    ) -> Option<[f32; 3]> {
        let (triangle, depth) = self.seen_at(u, v, mesh)?;
        let point = camera.unproject(f64::from(u), f64::from(v), depth);
        let point = camera_from_object.inverse_transform_point(&point);
        let [a, b, c] = mesh.corners(triangle).map(|corner| corner.cast::<f64>());
        let (edge, other, to) = (b - a, c - a, point - a);
        let normal = edge.cross(&other);
        let area = normal.norm_squared();
        if area <= 0.0 {
            return None;
        }
        let second = (to.cross(&other).dot(&normal) / area).clamp(0.0, 1.0);
        let third = (edge.cross(&to).dot(&normal) / area).clamp(0.0, 1.0 - second);
        #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
        let weights = [1.0 - second - third, second, third].map(|weight| weight as f32);
        mesh.color_at(triangle, weights)
    }

    /// Returns the triangle of `mesh` that an image pixel shows, and its depth there, meters.
    #[inline]
    fn seen_at(&self, u: u32, v: u32, mesh: &TriMesh) -> Option<(usize, f64)> {
        let index = self.region.index(u, v)?;
        let (triangle, depth) = (self.triangles[index] as usize, self.depth[index]);
        let seen = depth > 0.0 && triangle < mesh.triangles().len();
        seen.then_some((triangle, f64::from(depth)))
    }
}

/// The loop that counts the pixels with depth.
struct CountRendered<'a>(&'a [f32]);

impl VectorLoop for CountRendered<'_> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        // Chunks are small enough for 32-bit counters, and more of those fit into a vector.
        let count = |depths: &[f32]| depths.iter().map(|z| u32::from(*z > 0.0)).sum::<u32>();
        let chunks = self.0.chunks(1 << 16);
        chunks.map(|depths| count(depths) as usize).sum()
    }
}
