//! Renders of a whole image in one call.

use hicp_core::{DepthImage, Isometry3, PinholeCamera, RenderedView, Renderer, TriMesh};

use crate::rasterizer::Rasterizer;

/// Renders the depth of a mesh into an image of the camera's size, with the default [`Rasterizer`].
///
/// Depth is along the optical axis in meters. It is 0 where there is no surface, and beyond
/// [`MAX_DEPTH_METERS`](hicp_core::MAX_DEPTH_METERS). It is meant for tests, tools and first steps,
/// because it allocates all memory again and costs O(image). To render repeatedly, keep a
/// [`Rasterizer`] and a [`RenderedView`].
///
/// ```
/// use hicp_core::{Isometry3, PinholeCamera, Point3, TriMesh};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mesh = TriMesh::new(
///     vec![Point3::new(-9.0, -9.0, 0.0), Point3::new(9.0, -9.0, 0.0), Point3::new(0.0, 9.0, 0.0)],
///     vec![[0, 1, 2]],
/// )?;
/// let camera = PinholeCamera::new(40.0, 40.0, 15.5, 11.5, 32, 24)?;
/// let depth = hicp_raster::render_depth_image(&mesh, &camera, &Isometry3::translation(0.0, 0.0, 2.0));
/// assert!(depth.pixels().iter().all(|z| *z == 2.0));
/// # Ok(()) }
/// ```
#[must_use]
pub fn render_depth_image(
    mesh: &TriMesh,
    camera: &PinholeCamera,
    camera_from_object: &Isometry3<f64>,
) -> DepthImage {
    let mut view = RenderedView::default();
    Rasterizer::default().render(
        mesh,
        camera,
        camera_from_object,
        &camera.region(),
        &mut view,
    );
    let region = view.region();
    let width = camera.width() as usize;
    let mut meters = vec![0.0; camera.region().area()];
    if !region.is_empty() {
        let columns = region.u_min as usize..region.u_max as usize;
        let rows = meters.chunks_exact_mut(width).skip(region.v_min as usize);
        for (row, rendered) in rows.zip(view.depth().chunks_exact(region.width())) {
            row[columns.clone()].copy_from_slice(rendered);
        }
    }
    match DepthImage::from_meters(camera.width(), camera.height(), meters) {
        Ok(image) => image,
        Err(_) => unreachable!("the buffer was made for the camera's size"),
    }
}
