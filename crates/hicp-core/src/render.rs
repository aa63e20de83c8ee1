//! The renderer trait, the buffer that renderers fill, and the cache that avoids repeated renders.

use nalgebra::{Isometry3, UnitVector3};

use crate::id::Id;
use crate::internal::{VectorLoop, vectorized};
use crate::object::mesh::TriMesh;
use crate::object::model::Model;
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
    depth: Vec<f32>,
    triangles: Vec<u32>,
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

/// Renders the depth of a mesh at a pose.
///
/// # Contract
///
/// - Resets the view to the part of `region` that the projection of the mesh can cover, or to an
///   empty region if it cannot cover any. Work is proportional to the mesh and that part, never to
///   the image.
/// - Pixel (u, v) shows the nearest surface along the ray through ((u−cx)/fx, (v−cy)/fy, 1), as
///   depth (z) in meters, and the index of its triangle. Without a surface, the depth is 0 and the
///   triangle [`NO_TRIANGLE`].
/// - Surface nearer than the renderer's near plane is clipped. A mesh behind the camera renders
///   nothing.
/// - The result does not depend on the order of the triangles. Shared edges leave neither gaps nor
///   double hits.
/// - Equal inputs give equal bits, whatever was rendered before.
///
/// Use `Rasterizer` of `hicp-raster`, unless you need a custom renderer.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a renderer",
    label = "this must implement `Renderer`",
    note = "`Workspace::new` and `Refiner::with_renderer` accept a `Renderer`, such as `Rasterizer`"
)]
pub trait Renderer {
    /// Renders `mesh` at `camera_from_object` into `view`.
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    );
}

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<R: Renderer + ?Sized> Renderer for $pointer {
            fn render(
                &mut self,
                mesh: &TriMesh,
                camera: &PinholeCamera,
                camera_from_object: &Isometry3<f64>,
                region: &PixelRegion,
                view: &mut RenderedView,
            ) {
                (**self).render(mesh, camera, camera_from_object, region, view);
            }
        }
    )+};
}
forward!(Box<R>, &mut R);

/// Number of cached renders: Hybrid ICP requests the same pose at most a few renders apart.
const CACHED_VIEWS: usize = 4;

/// A renderer that caches its four most recently used renders.
///
/// A score and the selection that starts from the scored pose need the same render; the second
/// request costs a key comparison. The key is the model, the camera and the bits of the pose, so a
/// hit returns exactly what a render would.
pub struct RenderCache {
    renderer: Box<dyn Renderer + Send>,
    entries: [Entry; CACHED_VIEWS],
    clock: u64,
    rendered: u64,
}

#[derive(Default)]
struct Entry {
    key: Option<Key>,
    view: RenderedView,
    last_used: u64,
}

#[derive(Clone, Copy, PartialEq)]
struct Key {
    model: Id,
    /// `true` if the mesh is simplified.
    simplified: bool,
    camera: PinholeCamera,
    pose: [u64; 7],
}

impl RenderCache {
    /// Creates an empty cache around a renderer.
    pub fn new(renderer: impl Renderer + Send + 'static) -> Self {
        Self {
            renderer: Box::new(renderer),
            entries: Default::default(),
            clock: 0,
            rendered: 0,
        }
    }

    /// Returns the render of the whole image at a pose, `camera_from_object`, from the cache if
    /// possible.
    ///
    /// The view covers the part of the image that the model's projection can cover. Its triangles
    /// are those of [`Model::drawn`].
    pub fn view(
        &mut self,
        model: &Model,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
    ) -> &RenderedView {
        self.view_of(model, model.drawn(), camera, camera_from_object)
    }

    /// Returns the same with the triangles of one of the meshes of the model.
    pub(crate) fn view_of(
        &mut self,
        model: &Model,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
    ) -> &RenderedView {
        let key = Key {
            model: model.id(),
            simplified: !std::ptr::eq(mesh, model.mesh()),
            camera: *camera,
            pose: pose_bits(camera_from_object),
        };
        self.clock += 1;
        let hit = self.entries.iter().position(|entry| entry.key == Some(key));
        let oldest = || (0..CACHED_VIEWS).min_by_key(|index| self.entries[*index].last_used);
        let chosen = hit.or_else(oldest).unwrap_or_default();
        if hit.is_none() {
            self.rendered += 1;
            // Invalidate the key first: if the renderer panics, a half-filled view must not be
            // reused.
            self.entries[chosen].key = None;
            let view = &mut self.entries[chosen].view;
            let region = camera.region();
            self.renderer
                .render(mesh, camera, camera_from_object, &region, view);
            // All views grow together, so that allocations of a warm run do not depend on the
            // reused entry.
            let (capacity, area) = (view.depth.capacity(), view.depth.len());
            for entry in &mut self.entries {
                if entry.view.depth.capacity() < area {
                    let view = &mut entry.view;
                    view.depth.reserve(capacity - view.depth.len());
                    view.triangles.reserve(capacity - view.triangles.len());
                }
            }
            self.entries[chosen].key = Some(key);
        }
        let entry = &mut self.entries[chosen];
        entry.last_used = self.clock;
        &entry.view
    }

    /// Number of renders so far, without cache hits.
    #[must_use]
    pub fn renders(&self) -> u64 {
        self.rendered
    }
}

impl std::fmt::Debug for RenderCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RenderCache")
            .field("rendered", &self.rendered)
            .finish_non_exhaustive()
    }
}

/// Returns the bits of a pose, which are equal if it is, also with a NaN.
#[must_use]
pub fn pose_bits(pose: &Isometry3<f64>) -> [u64; 7] {
    let (t, q) = (&pose.translation.vector, &pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(f64::to_bits)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A renderer that covers the whole region.
    struct Flat;

    impl Renderer for Flat {
        fn render(
            &mut self,
            _: &TriMesh,
            _: &PinholeCamera,
            _: &Isometry3<f64>,
            region: &PixelRegion,
            view: &mut RenderedView,
        ) {
            view.reset(*region);
        }
    }

    #[test]
    fn all_views_grow_to_the_largest_and_not_much_beyond() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let corners = corners.map(nalgebra::Point3::from).to_vec();
        let model = Model::new(TriMesh::new(corners, vec![[0, 1, 2]]).unwrap());
        let mut cache = RenderCache::new(Flat);
        for side in [10, 15, 9, 34] {
            let camera = PinholeCamera::new(9.0, 9.0, 1.0, 1.0, side, side).unwrap();
            // Fill all entries, so that the next size replaces both empty and full ones.
            for step in 0..CACHED_VIEWS {
                let pose = Isometry3::translation(0.0, 0.0, 1.0 + step as f64);
                cache.view(&model, &camera, &pose);
                let largest = side.max(if side == 9 { 15 } else { 0 });
                let area = (largest * largest) as usize;
                for entry in &cache.entries {
                    for capacity in [entry.view.depth.capacity(), entry.view.triangles.capacity()] {
                        // Each size but the smallest doubles the pixels, so vectors request exactly
                        // what they need.
                        assert!((area..area + area / 4).contains(&capacity), "{capacity}");
                    }
                }
            }
        }
    }
}
