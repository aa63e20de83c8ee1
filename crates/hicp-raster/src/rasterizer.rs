//! The rasterizer: configuration, scratch and the triangle loop.

use hicp_core::internal::{VectorLoop, vectorized};
use hicp_core::{Facing, Isometry3, PinholeCamera, PixelRegion, RenderedView, Renderer, TriMesh};

use crate::clip::Clipper;
use crate::edge::{Coverage, Keep};
use crate::fill::Target;
use crate::fixed::{FixedPoint, GUARD_PIXELS};
use crate::inverse_depth::InverseDepth;
use crate::projection::{DEFAULT_NEAR_METERS, ProjectedVertex, Projection, effective_near};
use crate::region::Bounds;

/// The triangles that are skipped because they face away from the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Culling {
    /// Skips the back faces of closed meshes, and draws every other mesh two-sided.
    ///
    /// The mesh must be consistently wound ([`TriMesh::facing`]) and beyond the near plane with all
    /// its vertices. The depth is that of [`Culling::Never`] for half of the work. The two can
    /// differ only if a mesh intersects itself such that its inside is visible, and at a pixel
    /// center within 2⁻²⁰ pixel of the silhouette, where front and back meet.
    #[default]
    Auto,
    /// Draws every triangle two-sided.
    Never,
    /// Skips triangles that are clockwise as seen from the camera.
    ///
    /// It assumes, without a check, that the mesh is wound counter-clockwise as seen from outside.
    BackFaces,
}

/// Options of a [`Rasterizer`]. Any value is valid.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RasterConfig {
    /// Depth of the near plane, meters. Default: [`DEFAULT_NEAR_METERS`].
    ///
    /// Nearer surface is clipped. Values below 1 µm and NaN count as 1 µm.
    pub near_meters: f64,
    /// The triangles to skip because they face away. Default: [`Culling::Auto`].
    pub culling: Culling,
}

impl Default for RasterConfig {
    fn default() -> Self {
        Self {
            near_meters: DEFAULT_NEAR_METERS,
            culling: Culling::Auto,
        }
    }
}

/// Renders depth and visible triangles of meshes on the CPU; implements [`Renderer`].
///
/// It has a configuration and scratch memory, which grows with the largest mesh rendered: 40 bytes
/// per vertex. The result of a render depends only on its arguments and the configuration. Use one
/// per thread.
///
/// Beyond the contract of [`Renderer`]:
///
/// - The requested region is clipped to the image. The view is then reset to those of its pixels
///   whose centers lie in the bounding box of all projected vertices, used or not. If some vertices
///   are nearer than the near plane, the view has the whole clipped region. If all of them are, the
///   view is an empty region at the origin.
/// - The id of a pixel is the index of its triangle in [`TriMesh::triangles`]. Of several triangles
///   at the same depth, it is the first.
/// - Depth agrees with the intersection of the ray to two roundings to `f32`, 1.2·10⁻⁷ of its
///   value. Exceptions are positions within 2⁻²⁰ pixel of an edge, and triangles so nearly edge-on
///   that the vertices do not determine it. It always lies in the depth range of the triangle.
/// - A pose that is not finite, or beyond 10³⁰ m, shows nothing.
///
/// Cost: O(vertices + triangles + pixels of the view + covered pixels, including overdraw). The
/// first render of a mesh with [`Culling::Auto`] also computes its facing, once per mesh.
#[derive(Clone, Default)]
pub struct Rasterizer {
    config: RasterConfig,
    vertices: Vec<ProjectedVertex>,
    clipper: Clipper,
}

impl Rasterizer {
    /// Creates a rasterizer. Allocates nothing.
    #[must_use]
    pub fn new(config: RasterConfig) -> Self {
        Self {
            config,
            ..Self::default()
        }
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &RasterConfig {
        &self.config
    }

    /// Projects all vertices into the scratch buffer and returns their bounds.
    fn project(&mut self, mesh: &TriMesh, projection: &Projection, near: f64) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        self.vertices.clear();
        self.vertices.extend(mesh.vertices().iter().map(|point| {
            let h = projection.homogeneous(point);
            if h.z >= near {
                let inverse_depth = 1.0 / h.z;
                let (u, v) = (h.x * inverse_depth, h.y * inverse_depth);
                bounds.include(u, v);
                ProjectedVertex::new(u, v, inverse_depth)
            } else {
                bounds.cut = true;
                ProjectedVertex::TO_CLIP
            }
        }));
        bounds
    }

    fn keep(&self, mesh: &TriMesh, bounds: &Bounds) -> Keep {
        match self.config.culling {
            Culling::Never => Keep::Both,
            Culling::BackFaces => Keep::Negative,
            // The near plane opens a closed mesh, so its inside may be visible.
            Culling::Auto if bounds.cut => Keep::Both,
            Culling::Auto => match mesh.facing() {
                Facing::Outward => Keep::Negative,
                Facing::Inward => Keep::Positive,
                Facing::Unknown => Keep::Both,
            },
        }
    }
}

impl Renderer for Rasterizer {
    fn render(
        &mut self,
        mesh: &TriMesh,
        camera: &PinholeCamera,
        camera_from_object: &Isometry3<f64>,
        region: &PixelRegion,
        view: &mut RenderedView,
    ) {
        let near = effective_near(self.config.near_meters);
        let region = region.intersection(&camera.region());
        let Some(projection) = Projection::new(camera, camera_from_object) else {
            view.reset(PixelRegion::default());
            return;
        };
        let bounds = self.project(mesh, &projection, near);
        view.reset(bounds.region_within(&region));
        if view.region().is_empty() {
            return;
        }

        let keep = self.keep(mesh, &bounds);
        vectorized(Draw {
            mesh,
            vertices: &self.vertices,
            projection,
            near,
            keep,
            clipper: &mut self.clipper,
            target: Target::new(view),
        });
    }
}

/// The loop that draws the triangles of a mesh one after the other.
struct Draw<'a> {
    mesh: &'a TriMesh,
    vertices: &'a [ProjectedVertex],
    projection: Projection,
    near: f64,
    keep: Keep,
    clipper: &'a mut Clipper,
    target: Target<'a>,
}

impl VectorLoop for Draw<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        for (id, &[a, b, c]) in (0_u32..).zip(self.mesh.triangles()) {
            let [a, b, c] = [a, b, c].map(|i| &self.vertices[i as usize]);
            if a.inverse_depth > 0.0 && b.inverse_depth > 0.0 && c.inverse_depth > 0.0 {
                let region = &self.target.region;
                let coverage = Coverage::new(a.fixed, b.fixed, c.fixed, self.keep, region);
                if let Some(coverage) = coverage {
                    let plane = InverseDepth::through(a, b, c);
                    self.target.fill(&coverage, &plane, id);
                }
            } else {
                draw_clipped(&mut self, id);
            }
        }
    }
}

/// Draws the part of a triangle beyond the near plane and inside the guard band.
#[cold]
fn draw_clipped(draw: &mut Draw<'_>, id: u32) {
    let (mesh, projection) = (draw.mesh, &draw.projection);
    let triangle = mesh
        .corners(id as usize)
        .map(|corner| projection.homogeneous(&corner));
    let polygon = draw.clipper.clip(triangle, draw.near);
    // Infinities of both signs have met in clipping: beyond the range of `f64` there are no pixels.
    if !polygon.iter().all(|h| h.is_finite()) {
        return;
    }
    let (low, high) = polygon
        .iter()
        .map(|h| 1.0 / h.z)
        .fold((f64::INFINITY, 0.0_f64), |(low, high), w| {
            (low.min(w), high.max(w))
        });
    let plane = InverseDepth::through_homogeneous(triangle, low, high);
    let fixed = |index: usize| {
        let h = polygon[index];
        // If coordinates are so large that clipping is inexact, this keeps the integers in their
        // range.
        let limit = 2.0 * GUARD_PIXELS;
        FixedPoint::nearest(
            (h.x / h.z).clamp(-limit, limit),
            (h.y / h.z).clamp(-limit, limit),
        )
    };
    for second in 1..polygon.len().saturating_sub(1) {
        let (a, b, c) = (fixed(0), fixed(second), fixed(second + 1));
        if let Some(coverage) = Coverage::new(a, b, c, draw.keep, &draw.target.region) {
            draw.target.fill(&coverage, &plane, id);
        }
    }
}

impl std::fmt::Debug for Rasterizer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rasterizer")
            .field("config", &self.config)
            .finish_non_exhaustive()
    }
}
