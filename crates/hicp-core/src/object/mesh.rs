//! Triangle meshes.

use thiserror::Error;

use std::collections::HashMap;
use std::sync::OnceLock;

use nalgebra::{Point3, UnitVector3, Vector3};

use crate::internal::DisjointSets;
use crate::object::surface_color::SurfaceColor;

/// Largest accepted absolute vertex coordinate, meters.
///
/// Map grids reach this far: a UTM northing ends at 10 000 km. Far from the origin `f32` is coarse,
/// 0.5 m at 5000 km: see [`TriMesh::coordinate_step`].
pub const MAX_COORDINATE_METERS: f32 = 1.0e7;

/// Largest accepted number of vertices, and of triangles.
pub const MAX_MESH_ELEMENTS: usize = 50_000_000;

/// Returns the distance between adjacent `f32` numbers at the largest coordinate of points, meters.
pub fn coordinate_step(points: impl Iterator<Item = Point3<f32>>) -> f64 {
    let largest = points.fold(0.0_f32, |most, p| most.max(p.coords.amax()));
    f64::from(largest.next_up()) - f64::from(largest)
}

/// The side to which the triangles of a mesh face, if the mesh itself determines it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Facing {
    /// Closed and consistently wound, counter-clockwise as seen from outside: normals point out of
    /// the object.
    Outward,
    /// Closed and consistently wound in the opposite direction: normals point into the object.
    Inward,
    /// Open, inconsistently wound, or with parts that disagree: the winding determines nothing.
    Unknown,
}

/// A triangle mesh in meters, in the object frame.
///
/// Coordinates are finite, indices are valid, and at least one triangle has an area;
/// [`TriMesh::new`] refuses anything else. Unused vertices and triangles of zero area may exist.
/// They affect nothing but [`TriMesh::vertices`], [`TriMesh::triangles`] and the time of renders:
/// an unused vertex far from the object makes their regions larger.
///
/// ```
/// use hicp_core::{Point3, TriMesh};
/// # fn main() -> Result<(), hicp_core::MeshError> {
/// let mesh = TriMesh::new(
///     vec![Point3::origin(), Point3::new(0.1, 0.0, 0.0), Point3::new(0.0, 0.1, 0.0)],
///     vec![[0, 1, 2]],
/// )?;
/// assert!((mesh.area() - 0.005).abs() < 1e-9);
/// # Ok(()) }
/// ```
#[derive(Clone, Debug)]
pub struct TriMesh {
    vertices: Vec<Point3<f32>>,
    triangles: Vec<[u32; 3]>,
    color: Option<SurfaceColor>,
    facing: OnceLock<Facing>,
    /// The unit normals of the triangles; zero if a triangle has no area.
    normals: OnceLock<Vec<Vector3<f32>>>,
}

impl TriMesh {
    /// Creates a mesh from vertices in meters and triangles of vertex indices, counted from 0.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if there are no triangles, an index is out of range, a coordinate is not
    /// finite or beyond [`MAX_COORDINATE_METERS`], no triangle has an area, or there are more than
    /// [`MAX_MESH_ELEMENTS`].
    pub fn new(vertices: Vec<Point3<f32>>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        for (what, count) in [("vertices", vertices.len()), ("triangles", triangles.len())] {
            if count > MAX_MESH_ELEMENTS {
                return Err(MeshError::TooLarge {
                    what,
                    count,
                    limit: MAX_MESH_ELEMENTS,
                });
            }
        }
        if triangles.is_empty() {
            return Err(MeshError::NoTriangles {
                vertices: vertices.len(),
            });
        }
        for (vertex, p) in vertices.iter().enumerate() {
            if !p.iter().all(|x| x.abs() <= MAX_COORDINATE_METERS) {
                return Err(MeshError::Coordinate {
                    vertex,
                    x: p.x,
                    y: p.y,
                    z: p.z,
                    limit: MAX_COORDINATE_METERS,
                });
            }
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|i| **i as usize >= vertices.len()) {
                return Err(MeshError::IndexOutOfRange {
                    triangle,
                    index,
                    vertices: vertices.len(),
                });
            }
        }
        let mesh = Self {
            vertices,
            triangles,
            color: None,
            facing: OnceLock::new(),
            normals: OnceLock::new(),
        };
        if mesh.area() > 0.0 {
            Ok(mesh)
        } else {
            Err(MeshError::NoArea {
                triangles: mesh.triangles.len(),
            })
        }
    }

    /// The vertices, in meters in the object frame.
    #[must_use]
    pub fn vertices(&self) -> &[Point3<f32>] {
        &self.vertices
    }

    /// The triangles as indices into [`TriMesh::vertices`].
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the corners of a triangle, in meters in the object frame.
    ///
    /// # Panics
    ///
    /// If `triangle` is not below the number of triangles.
    #[must_use]
    #[inline]
    pub fn corners(&self, triangle: usize) -> [Point3<f32>; 3] {
        self.triangles[triangle].map(|i| self.vertices[i as usize])
    }

    /// Returns the unit normal of a triangle, or `None` if its area is zero.
    ///
    /// The winding determines its sign: the corners are counter-clockwise as seen from its tip. The
    /// first call computes the normals of all triangles, 12 bytes each.
    ///
    /// # Panics
    ///
    /// If `triangle` is not below the number of triangles.
    #[must_use]
    #[inline]
    pub fn normal(&self, triangle: usize) -> Option<UnitVector3<f32>> {
        let normals = self.normals.get_or_init(|| {
            let triangles = 0..self.triangles.len();
            triangles
                .map(|triangle| {
                    let double_area = self.double_area_vector(triangle);
                    let norm = double_area.norm();
                    if norm > 0.0 {
                        (double_area / norm).cast::<f32>()
                    } else {
                        Vector3::zeros()
                    }
                })
                .collect()
        });
        let normal = normals[triangle];
        (normal != Vector3::zeros()).then(|| UnitVector3::new_unchecked(normal))
    }

    /// Returns the mesh with the color of its surface. No geometric computation depends on it.
    ///
    /// # Errors
    ///
    /// [`MeshError::ColorCount`] if there is not one color per vertex, or one textured triangle per
    /// triangle. [`MeshError::NoTexture`] if a triangle refers to an image that does not exist or
    /// has no pixels.
    pub fn with_color(mut self, color: SurfaceColor) -> Result<Self, MeshError> {
        let (what, found, expected) = match &color {
            SurfaceColor::Vertices(colors) => ("vertex colors", colors.len(), self.vertices.len()),
            SurfaceColor::Textures { triangles, .. } => {
                let what = "textured triangles";
                (what, triangles.len(), self.triangles.len())
            }
        };
        if found != expected {
            return Err(MeshError::ColorCount {
                what,
                found,
                expected,
            });
        }
        if let SurfaceColor::Textures { images, triangles } = &color {
            for (triangle, textured) in triangles.iter().enumerate() {
                let image = images.get(textured.image as usize);
                if image.is_none_or(|image| image.pixels().is_empty()) {
                    return Err(MeshError::NoTexture {
                        triangle,
                        image: textured.image,
                        images: images.len(),
                    });
                }
            }
        }
        self.color = Some(color);
        Ok(self)
    }

    /// The color of the surface, if it is known.
    #[must_use]
    pub fn color(&self) -> Option<&SurfaceColor> {
        self.color.as_ref()
    }

    /// Returns the color at a place of a triangle: red, green and blue from 0 to 255.
    ///
    /// `weights` are the barycentric coordinates of the place: the shares of the three corners.
    /// Returns `None` if the mesh has no color.
    ///
    /// # Panics
    ///
    /// If `triangle` is not below the number of triangles.
    #[must_use]
    pub fn color_at(&self, triangle: usize, weights: [f32; 3]) -> Option<[f32; 3]> {
        let color = self.color.as_ref()?;
        Some(color.at(triangle, self.triangles[triangle], weights))
    }

    /// Returns the surface area, m².
    #[must_use]
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| self.triangle_area(t))
            .sum()
    }

    /// Returns the area of a triangle, m².
    ///
    /// # Panics
    ///
    /// If `triangle` is not below the number of triangles.
    #[must_use]
    #[inline]
    pub fn triangle_area(&self, triangle: usize) -> f64 {
        0.5 * self.double_area_vector(triangle).norm()
    }

    #[inline]
    fn double_area_vector(&self, triangle: usize) -> Vector3<f64> {
        let [a, b, c] = self.corners(triangle).map(|p| p.cast::<f64>());
        (b - a).cross(&(c - a))
    }

    /// Returns the distance between adjacent `f32` numbers at the largest used coordinate, meters.
    ///
    /// Half of it is the rounding that reading the mesh may have cost. If it exceeds a thousandth
    /// of the diameter, the mesh is too coarse for registration: move the mesh to its origin.
    ///
    /// Cost: O(triangles).
    #[must_use]
    pub fn coordinate_step(&self) -> f64 {
        coordinate_step(self.used_points())
    }

    /// Returns, for every vertex, whether a triangle uses it.
    #[must_use]
    pub fn used_vertices(&self) -> Vec<bool> {
        let mut used = vec![false; self.vertices.len()];
        for index in self.triangles.iter().flatten() {
            used[*index as usize] = true;
        }
        used
    }

    /// Iterates over the positions of the vertices that triangles use, in their order.
    ///
    /// Positions are in meters in the object frame. Cost: O(triangles) for the first.
    pub fn used_points(&self) -> impl Iterator<Item = Point3<f32>> + '_ {
        let used = self.used_vertices().into_iter().zip(&self.vertices);
        used.filter_map(|(used, vertex)| used.then_some(*vertex))
    }

    /// Returns the side to which the triangles face, computed on first use and kept.
    ///
    /// Vertices at the same position count as one, so that seams of texture coordinates do not open
    /// a mesh. Cost: O(triangles), once.
    #[must_use]
    pub fn facing(&self) -> Facing {
        *self.facing.get_or_init(|| find_facing(self))
    }

    /// Returns the mesh with a known facing.
    pub(crate) fn with_facing(self, facing: Facing) -> Self {
        Self {
            facing: OnceLock::from(facing),
            ..self
        }
    }

    /// Returns whether the mesh is closed and consistently wound, so that back faces are never
    /// visible.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.facing() != Facing::Unknown
    }
}

/// Determines closedness from directed edges, and orientation from the signed volume of every part.
fn find_facing(mesh: &TriMesh) -> Facing {
    let triangles = welded_triangles(mesh);
    let edges = edge_uses(&triangles);
    if edges.is_empty() || edges.values().any(|uses| *uses != [1, 1]) {
        return Facing::Unknown;
    }

    let mut parts = DisjointSets::of(mesh.vertices().len(), &triangles);
    // The volume of a closed part does not depend on the origin. One of its own vertices as the
    // origin keeps the sum well conditioned.
    let mut volumes: HashMap<usize, (Point3<f64>, f64)> = HashMap::new();
    for corners in &triangles {
        let [a, b, c] = corners.map(|i| mesh.vertices()[i as usize].cast::<f64>());
        let (origin, volume) = volumes
            .entry(parts.find(corners[0] as usize))
            .or_insert((a, 0.0));
        *volume += (a - *origin).dot(&(b - *origin).cross(&(c - *origin)));
    }
    if volumes.values().all(|(_, volume)| *volume > 0.0) {
        Facing::Outward
    } else if volumes.values().all(|(_, volume)| *volume < 0.0) {
        Facing::Inward
    } else {
        Facing::Unknown
    }
}

/// Returns the triangles with three different positions, over the first vertex at each of them.
pub(crate) fn welded_triangles(mesh: &TriMesh) -> Vec<[u32; 3]> {
    let vertices = mesh.vertices();
    let mut first_at: HashMap<[u32; 3], u32> = HashMap::with_capacity(vertices.len());
    let welded: Vec<u32> = (0_u32..)
        .zip(vertices)
        .map(|(index, p)| {
            // Adding 0 changes −0 to +0.
            let key = [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits());
            *first_at.entry(key).or_insert(index)
        })
        .collect();
    let triangles = mesh.triangles().iter();
    triangles
        .map(|corners| corners.map(|i| welded[i as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect()
}

/// Returns how many triangles use each edge in upward and in downward direction.
///
/// A closed, consistently wound surface uses every edge once in each direction.
pub(crate) fn edge_uses(triangles: &[[u32; 3]]) -> HashMap<(u32, u32), [u32; 2]> {
    let mut edges: HashMap<(u32, u32), [u32; 2]> = HashMap::with_capacity(2 * triangles.len());
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let uses = edges.entry((from.min(to), from.max(to))).or_default();
            uses[usize::from(from > to)] += 1;
        }
    }
    edges
}

/// The reason why vertices and triangles do not form a mesh.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MeshError {
    /// There are no triangles.
    #[error("mesh has {vertices} vertices but no triangle, expected at least one triangle")]
    NoTriangles {
        /// Number of vertices.
        vertices: usize,
    },
    /// There are more vertices or triangles than supported.
    #[error("mesh has {count} {what}, expected at most {limit}")]
    TooLarge {
        /// `vertices` or `triangles`.
        what: &'static str,
        /// The number found.
        count: usize,
        /// The largest accepted number.
        limit: usize,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error(
        "triangle {triangle} uses vertex {index}, but there are {vertices} vertices (counted from 0)"
    )]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex index found.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A coordinate of a vertex, used or not, is not finite or too large.
    #[error("vertex {vertex} is ({x}, {y}, {z}) m, expected finite coordinates within ±{limit} m")]
    Coordinate {
        /// Index of the vertex.
        vertex: usize,
        /// x.
        x: f32,
        /// y.
        y: f32,
        /// z.
        z: f32,
        /// Largest accepted absolute coordinate, meters.
        limit: f32,
    },
    /// The number of colors does not match the mesh.
    #[error("mesh has {found} {what}, expected {expected}")]
    ColorCount {
        /// `vertex colors` or `textured triangles`.
        what: &'static str,
        /// The number found.
        found: usize,
        /// The number of vertices or triangles.
        expected: usize,
    },
    /// A triangle refers to a texture that does not exist or has no pixels.
    #[error(
        "triangle {triangle} uses texture {image}, expected one of {images} (counted from 0) with pixels"
    )]
    NoTexture {
        /// Index of the triangle.
        triangle: usize,
        /// Index of the image.
        image: u32,
        /// Number of images.
        images: usize,
    },
    /// Every triangle has zero area.
    #[error("all {triangles} triangles have zero area, expected at least one with an area")]
    NoArea {
        /// Number of triangles.
        triangles: usize,
    },
}
