//! Rendering: the trait that rasterizers implement, the buffer they fill, and the cache that keeps renders from being repeated.

use nalgebra::{Isometry3, UnitVector3};

use crate::camera::PinholeCamera;
use crate::id::Id;
use crate::mesh::TriMesh;
use crate::model::Model;
use crate::region::PixelRegion;
use crate::surfel::Surfel;

/// The triangle id of a pixel that shows nothing.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// A rendered region of an image: depth and visible triangle per pixel. The caller owns and reuses it.
///
/// Buffers are row-major over [`RenderedView::region`]. Depth is along the optical axis in metres, 0 where there is
/// nothing; the triangle is [`NO_TRIANGLE`] there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderedView {
    region: PixelRegion,
    depth: Vec<f32>,
    triangles: Vec<u32>,
}

impl RenderedView {
    /// Empties the view and makes it cover `region`. Allocates only when the region is larger than any before.
    ///
    /// # Panics
    ///
    /// When eight bytes per pixel are more than memory can hold; no camera has sides above [`MAX_IMAGE_SIDE`](crate::MAX_IMAGE_SIDE).
    pub fn reset(&mut self, region: PixelRegion) {
        self.region = region;
        self.depth.clear();
        self.depth.resize(region.area(), 0.0);
        self.triangles.clear();
        self.triangles.resize(region.area(), NO_TRIANGLE);
    }

    /// Makes this view equal to another, reusing its own memory.
    pub fn copy_from(&mut self, other: &Self) {
        self.region = other.region;
        self.depth.clone_from(&other.depth);
        self.triangles.clone_from(&other.triangles);
    }

    /// The region that the buffers cover.
    #[must_use]
    pub fn region(&self) -> PixelRegion {
        self.region
    }

    /// Depth along the optical axis, metres, 0 where there is nothing.
    #[must_use]
    pub fn depth(&self) -> &[f32] {
        &self.depth
    }

    /// Index of the visible triangle, [`NO_TRIANGLE`] where there is nothing.
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
        // Few enough at a time for 32 bits, of which a vector holds twice as many.
        let count = |depths: &[f32]| depths.iter().map(|z| u32::from(*z > 0.0)).sum::<u32>();
        self.depth
            .chunks(1 << 16)
            .map(|depths| count(depths) as usize)
            .sum()
    }

    /// Returns the depth at an image pixel: 0 where nothing was rendered, and outside the region.
    #[must_use]
    pub fn depth_at(&self, u: u32, v: u32) -> f32 {
        self.region.index(u, v).map_or(0.0, |i| self.depth[i])
    }

    /// Returns the rendered surface at an image pixel, in the camera frame with the normal facing the camera.
    ///
    /// `None` where nothing was rendered, and for a triangle that `mesh` does not have. `mesh`, `camera` and `camera_from_object` must be
    /// those of the render.
    #[must_use]
    pub fn surfel_at(
        &self,
        u: u32,
        v: u32,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
    ) -> Option<Surfel> {
        let index = self.region.index(u, v)?;
        let depth = self.depth[index];
        if depth <= 0.0 {
            return None;
        }
        let triangle = self.triangles[index] as usize;
        if triangle >= mesh.triangles().len() {
            return None;
        }
        let normal = mesh.normal(triangle)?;
        let point = camera.unproject(f64::from(u), f64::from(v), f64::from(depth));
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
}

/// Renders the depth of a mesh at a pose.
///
/// # Contract
///
/// - The view is reset to the part of `region` that the projection of the mesh can cover, and to an empty region when
///   there is none; work is proportional to the mesh and that part, never to the image.
/// - Pixel (u, v) shows the surface along the ray through ((u−cx)/fx, (v−cy)/fy, 1): the nearest, as depth (z) in metres.
/// - Surface nearer than the renderer's near plane is cut away; a mesh behind the camera renders nothing.
/// - The result does not depend on the order of the triangles, and shared edges leave neither gaps nor double hits.
/// - Equal inputs give equal bits, whatever was rendered before.
///
/// `Rasterizer` in `hicp-raster` is the implementation to use.
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

impl<R: Renderer + ?Sized> Renderer for Box<R> {
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

/// Number of renders kept: a Hybrid ICP iteration asks for the same pose at most a few renders apart.
const CACHED_VIEWS: usize = 4;

/// A renderer that remembers its last renders: the four that were used last.
///
/// The score that looks at a pose and the selection that starts from it ask for the same render; whoever comes second
/// gets it for the price of a key comparison. Keyed by model, camera and the bits of the pose, so a hit returns exactly
/// what a render would.
pub struct RenderCache {
    renderer: Box<dyn Renderer + Send>,
    entries: Vec<Entry>,
    clock: u64,
    rendered: u64,
}

struct Entry {
    key: Option<Key>,
    view: RenderedView,
    last_used: u64,
}

#[derive(Clone, Copy, PartialEq)]
struct Key {
    model: Id,
    camera: PinholeCamera,
    pose: [u64; 7],
}

impl RenderCache {
    /// Makes an empty cache around a renderer.
    pub fn new(renderer: impl Renderer + Send + 'static) -> Self {
        Self {
            renderer: Box::new(renderer),
            entries: (0..CACHED_VIEWS)
                .map(|_| Entry {
                    key: None,
                    view: RenderedView::default(),
                    last_used: 0,
                })
                .collect(),
            clock: 0,
            rendered: 0,
        }
    }

    /// Returns the render of the whole image at a pose, from the cache when it is there.
    ///
    /// The view covers the part of the image that the model's projection can cover.
    pub fn view(
        &mut self,
        model: &Model,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
    ) -> &RenderedView {
        let key = Key {
            model: model.id(),
            camera: *camera,
            pose: pose_bits(camera_from_object),
        };
        self.clock += 1;
        let mut chosen = 0;
        let mut hit = false;
        for (index, entry) in self.entries.iter().enumerate() {
            if entry.key == Some(key) {
                (chosen, hit) = (index, true);
                break;
            }
            if entry.last_used < self.entries[chosen].last_used {
                chosen = index;
            }
        }
        if !hit {
            self.rendered += 1;
            // Whoever catches a renderer's panic must not find its half-filled view under the old key.
            self.entries[chosen].key = None;
            let view = &mut self.entries[chosen].view;
            self.renderer.render(
                model.mesh(),
                camera,
                camera_from_object,
                &camera.region(),
                view,
            );
            // All views grow together, so that which of them a warm run happens to reuse decides nothing.
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

    /// Number of renders made so far, hits not counted.
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

fn pose_bits(pose: &Isometry3<f64>) -> [u64; 7] {
    let (t, q) = (&pose.translation.vector, &pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(f64::to_bits)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Shows the whole region.
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
    fn all_views_grow_with_the_largest_and_not_much_beyond() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let corners = corners.map(nalgebra::Point3::from).to_vec();
        let model = Model::new(TriMesh::new(corners, vec![[0, 1, 2]]).unwrap());
        let mut cache = RenderCache::new(Flat);
        for side in [10, 15, 9, 34] {
            let camera = PinholeCamera::new(9.0, 9.0, 1.0, 1.0, side, side).unwrap();
            // From one entry to all of them, so that the next size meets both empty and full ones.
            for step in 0..CACHED_VIEWS {
                let pose = Isometry3::translation(0.0, 0.0, 1.0 + step as f64);
                cache.view(&model, &camera, &pose);
                let largest = side.max(if side == 9 { 15 } else { 0 });
                let area = (largest * largest) as usize;
                for entry in &cache.entries {
                    for capacity in [entry.view.depth.capacity(), entry.view.triangles.capacity()] {
                        // Each size but the smallest has twice the pixels of the one before, so that a vector asks for no more than it wants.
                        assert!((area..area + area / 4).contains(&capacity), "{capacity}");
                    }
                }
            }
        }
    }
}
