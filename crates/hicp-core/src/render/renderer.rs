//! The trait of renderers.

use nalgebra::Isometry3;

use crate::object::mesh::TriMesh;
use crate::render::view::RenderedView;
use crate::sensor::camera::PinholeCamera;
use crate::sensor::region::PixelRegion;

/// Renders the depth of a mesh at a pose.
///
/// # Contract
///
/// - Resets the view to the part of `region` that the projection of the mesh can cover, or to an
///   empty region if it cannot cover any. Work is proportional to the mesh and that part, never to
///   the image.
/// - Pixel (u, v) shows the nearest surface along the ray through ((u−cx)/fx, (v−cy)/fy, 1), as
///   depth (z) in meters, and the index of its triangle. Without a surface, the depth is 0 and the
///   triangle [`NO_TRIANGLE`](crate::NO_TRIANGLE).
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
