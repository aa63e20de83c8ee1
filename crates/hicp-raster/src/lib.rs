//! A software rasterizer: depth and visible triangle of a mesh at a pose.
//!
//! [`Rasterizer`] implements [`hicp_core::Renderer`] on the CPU. It is built for pose refinement,
//! which renders one mesh of some thousand triangles thousands of times, in a small part of the
//! image. The work is proportional to the mesh and the covered pixels, and a warm rasterizer
//! allocates nothing.
//!
//! # Should you use this crate?
//!
//! Yes, to render depth or visible triangles of a mesh without a GPU, with the same result on every
//! run and every machine. No, if you need color, texture, anti-aliasing, lens distortion or
//! transparency. `hicp-core` is re-exported.
//!
//! # Exactness
//!
//! - Pixel (u, v) samples the ray through ((u−cx)/fx, (v−cy)/fy, 1). A [`hicp_core::PinholeCamera`]
//!   has its pixel centers at integers for every convention of its calibration (see
//!   [`hicp_core::PixelCenters`]), so half a pixel is never added here.
//! - Coverage is decided in integers: projected vertices are rounded to a grid of 2⁻²⁰ pixel, and
//!   edge functions are exact from there on. By the top-left rule, triangles that share an edge
//!   leave no gap and never both cover a pixel.
//! - Depth comes from the plane through the vertices before rounding, in `f64`, and is rounded to
//!   `f32` once.
//! - The bits of a pixel do not depend on the requested region, on earlier renders, or on the order
//!   of triangles. If two triangles have the same depth, the reported one is the first in the mesh.
//!
//! # Example
//!
//! ```
//! use hicp_raster::Rasterizer;
//! use hicp_raster::hicp_core::{Isometry3, PinholeCamera, Point3, RenderedView, Renderer, TriMesh};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mesh = TriMesh::new(
//!     vec![
//!         Point3::new(-0.1, -0.1, 0.0),
//!         Point3::new(0.1, -0.1, 0.0),
//!         Point3::new(0.0, 0.1, 0.0),
//!     ],
//!     vec![[0, 1, 2]],
//! )?;
//! let camera = PinholeCamera::new(600.0, 600.0, 319.5, 239.5, 640, 480)?;
//! let camera_from_object = Isometry3::translation(0.0, 0.0, 0.5);
//!
//! let mut rasterizer = Rasterizer::default();
//! let mut view = RenderedView::default();
//! rasterizer.render(&mesh, &camera, &camera_from_object, &camera.region(), &mut view);
//!
//! assert_eq!(view.depth_at(320, 240), 0.5);
//! assert_eq!(view.depth_at(0, 0), 0.0);
//! assert!(view.region().area() < 250 * 250); // only the part that the triangle can cover
//! # Ok(()) }
//! ```

mod clip;
mod edge;
mod fill;
mod fixed;
mod image;
mod inverse_depth;
mod projection;
mod rasterizer;
mod region;

pub use hicp_core;
pub use image::render_depth_image;
pub use projection::DEFAULT_NEAR_METERS;
pub use rasterizer::{Culling, RasterConfig, Rasterizer};
