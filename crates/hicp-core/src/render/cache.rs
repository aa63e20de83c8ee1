//! The cache that avoids repeated renders.

use nalgebra::Isometry3;

use crate::id::Id;
use crate::object::mesh::TriMesh;
use crate::object::model::Model;
use crate::render::renderer::Renderer;
use crate::render::view::RenderedView;
use crate::sensor::camera::PinholeCamera;

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
    use crate::sensor::region::PixelRegion;

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
