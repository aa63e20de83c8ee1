//! Closed meshes from sampled scalar fields, by marching cubes with a generated table.
//!
//! Lorensen & Cline 1987 do not define how to treat faces with two diagonal corners inside.
//! Neighboring cells must decide alike, or the surface has holes. Here, one segment cuts off each
//! run of inside corners around a face, which depends only on the face. The segments form loops.
//! Each loop is filled by a fan whose diagonals do not lie in a face, or otherwise by triangles
//! around its center. As a result, every edge belongs to exactly two triangles, and the triangles
//! around every vertex form one disc.

use std::collections::HashMap;

use hicp_core::internal::index;
use hicp_core::{Point3, TriMesh, Vector3};

use crate::error::SimError;

/// Finite samples of a scalar field on a regular grid, negative inside.
#[derive(Clone, Debug)]
pub struct ScalarGrid {
    /// Position of sample (0, 0, 0), meters.
    pub origin: Point3<f64>,
    /// Distance between neighboring samples, meters.
    pub spacing: f64,
    /// Number of samples along x, y and z.
    pub size: [usize; 3],
    /// The samples, with x varying fastest: index (k · `size[1]` + j) · `size[0]` + i.
    pub values: Vec<f32>,
}

/// Smallest distance of a vertex from a sample, as a share of the spacing.
///
/// It ensures that vertices of different edges never coincide.
const VERTEX_MARGIN: f32 = 0.01;

impl ScalarGrid {
    /// Returns the surface at which the field changes its sign, facing the positive side.
    ///
    /// The surface is manifold and consistently wound. It is closed if the samples at the border of
    /// the grid are positive. Vertices are interpolated linearly.
    ///
    /// Cost: O(samples).
    ///
    /// # Errors
    ///
    /// - [`SimError::VolumeSize`] if `values` does not have one sample per grid point, or if there
    ///   are fewer than two samples along an axis.
    /// - [`SimError::Mesh`] if there is no surface.
    pub fn surface(&self) -> Result<TriMesh, SimError> {
        let [nx, ny, nz] = self.size;
        if self.values.len() != nx * ny * nz || self.size.iter().any(|n| *n < 2) {
            let (size, limit) = (self.size, self.values.len());
            return Err(SimError::VolumeSize { size, limit });
        }
        let table = table();
        let mut surface = Surface {
            grid: self,
            vertex_on: HashMap::new(),
            vertices: Vec::new(),
            triangles: Vec::new(),
        };
        for k in 0..nz - 1 {
            for j in 0..ny - 1 {
                for i in 0..nx - 1 {
                    let corner = |c: usize| self.index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                    let values: [f32; 8] = std::array::from_fn(|c| self.values[corner(c)]);
                    let inside = (0..8)
                        .filter(|c| values[*c] < 0.0)
                        .fold(0, |bits, c| bits | 1 << c);
                    for polygon in &table[inside] {
                        surface.fill(polygon, [i, j, k]);
                    }
                }
            }
        }
        Ok(TriMesh::new(surface.vertices, surface.triangles)?)
    }

    fn index(&self, i: usize, j: usize, k: usize) -> usize {
        (k * self.size[1] + j) * self.size[0] + i
    }
}

/// A mesh under construction.
struct Surface<'a> {
    grid: &'a ScalarGrid,
    /// The vertex on a grid edge. The key is three times the index of the edge's first sample plus
    /// its axis.
    vertex_on: HashMap<usize, u32>,
    vertices: Vec<Point3<f32>>,
    triangles: Vec<[u32; 3]>,
}

impl Surface<'_> {
    /// Fills one polygon of the cell at a sample.
    fn fill(&mut self, polygon: &Polygon, cell: [usize; 3]) {
        let corners: Vec<u32> = polygon
            .edges
            .iter()
            .map(|edge| self.vertex(*edge, cell))
            .collect();
        let n = corners.len();
        if polygon.around_center {
            let sum = corners.iter().fold(Vector3::zeros(), |sum, v| {
                sum + self.vertices[*v as usize].coords
            });
            let center = self.push(Point3::from(sum / n as f32));
            self.triangles
                .extend((0..n).map(|i| [center, corners[i], corners[(i + 1) % n]]));
        } else {
            self.triangles
                .extend((1..n - 1).map(|i| [corners[0], corners[i], corners[i + 1]]));
        }
    }

    fn vertex(&mut self, edge: Edge, [i, j, k]: [usize; 3]) -> u32 {
        let mut at = [
            i + (edge.corner & 1),
            j + (edge.corner >> 1 & 1),
            k + (edge.corner >> 2),
        ];
        let first = self.grid.index(at[0], at[1], at[2]);
        let key = 3 * first + edge.axis;
        if let Some(vertex) = self.vertex_on.get(&key) {
            return *vertex;
        }
        let mut position = at.map(|n| n as f64);
        at[edge.axis] += 1;
        let (a, b) = (
            self.grid.values[first],
            self.grid.values[self.grid.index(at[0], at[1], at[2])],
        );
        position[edge.axis] += f64::from((a / (a - b)).clamp(VERTEX_MARGIN, 1.0 - VERTEX_MARGIN));
        let point = self.grid.origin.coords + Vector3::from(position) * self.grid.spacing;
        let vertex = self.push(Point3::from(point.cast::<f32>()));
        self.vertex_on.insert(key, vertex);
        vertex
    }

    fn push(&mut self, point: Point3<f32>) -> u32 {
        self.vertices.push(point);
        index(self.vertices.len() - 1)
    }
}

/// An edge of a cell: from a corner (bits x, y, z) along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Edge {
    corner: usize,
    axis: usize,
}

impl Edge {
    fn between(a: usize, b: usize) -> Self {
        let axis = match a ^ b {
            1 => 0,
            2 => 1,
            _ => 2,
        };
        Self {
            corner: a & b,
            axis,
        }
    }

    fn number(self) -> usize {
        3 * self.corner + self.axis
    }

    /// Returns whether two edges lie in one face of the cell.
    fn shares_face(self, other: Self) -> bool {
        (0..3).any(|axis| {
            let side = 1 << axis;
            self.axis != axis && other.axis != axis && self.corner & side == other.corner & side
        })
    }
}

/// A polygon of the surface within a cell, counter-clockwise when seen from outside the object.
#[derive(Clone, Debug)]
struct Polygon {
    /// The edges on which its corners lie. A fan starts at the first.
    edges: Vec<Edge>,
    /// `true` if every fan would have a diagonal in a face. The neighboring cell might have a
    /// diagonal there, too.
    around_center: bool,
}

/// Corners of the six faces, counter-clockwise when seen from outside the cell.
const FACES: [[usize; 4]; 6] = [
    [0, 4, 6, 2],
    [1, 3, 7, 5],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 2, 3, 1],
    [4, 5, 7, 6],
];

/// Returns the polygons of a cell for each of the 256 sets of inside corners.
fn table() -> Vec<Vec<Polygon>> {
    (0..256).map(polygons).collect()
}

fn polygons(inside: usize) -> Vec<Polygon> {
    let is_inside = |corner: usize| inside >> corner & 1 == 1;
    // On every face, a segment cuts off each run of inside corners, from the edge that enters the
    // run to the edge that leaves it.
    let mut next: [Option<Edge>; 24] = [None; 24];
    for face in FACES {
        for start in 0..4 {
            let (before, first) = (face[(start + 3) % 4], face[start]);
            if is_inside(before) || !is_inside(first) {
                continue;
            }
            let mut end = start;
            while is_inside(face[(end + 1) % 4]) {
                end += 1;
            }
            let left = Edge::between(face[end % 4], face[(end + 1) % 4]);
            next[Edge::between(before, first).number()] = Some(left);
        }
    }
    // An edge that enters on one face leaves on the other, so the segments form closed loops.
    let mut polygons = Vec::new();
    for corner in 0..8 {
        for axis in 0..3 {
            let mut edges = Vec::new();
            let mut at = Edge { corner, axis };
            while let Some(following) = next[at.number()].take() {
                edges.push(at);
                at = following;
            }
            if !edges.is_empty() {
                polygons.push(triangulate(edges));
            }
        }
    }
    polygons
}

fn triangulate(edges: Vec<Edge>) -> Polygon {
    let n = edges.len();
    let fan_at = |apex: usize| (2..n - 1).all(|i| !edges[apex].shares_face(edges[(apex + i) % n]));
    let apex = (0..n).find(|apex| fan_at(*apex));
    let mut edges_from = edges.clone();
    edges_from.rotate_left(apex.unwrap_or(0));
    Polygon {
        edges: edges_from,
        around_center: apex.is_none(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;
    use hicp_core::Facing;
    use rand::RngExt;
    use std::collections::HashSet;

    fn grid(size: usize, mut value: impl FnMut(usize, usize, usize) -> f32) -> ScalarGrid {
        let mut values = Vec::new();
        for k in 0..size {
            for j in 0..size {
                for i in 0..size {
                    values.push(value(i, j, k));
                }
            }
        }
        ScalarGrid {
            origin: Point3::origin(),
            spacing: 0.01,
            size: [size; 3],
            values,
        }
    }

    /// Checks that the triangles around every vertex form one disc.
    fn assert_manifold(mesh: &TriMesh) {
        assert_ne!(mesh.facing(), Facing::Unknown);
        let mut around: HashMap<u32, Vec<(u32, u32)>> = HashMap::new();
        for &[a, b, c] in mesh.triangles() {
            for (v, from, to) in [(a, b, c), (b, c, a), (c, a, b)] {
                around.entry(v).or_default().push((from, to));
            }
        }
        for (vertex, links) in around {
            let next: HashMap<u32, u32> = links.iter().copied().collect();
            assert_eq!(
                next.len(),
                links.len(),
                "an edge at {vertex} has several triangles on a side"
            );
            let (start, mut at, mut steps) = (links[0].0, links[0].1, 1);
            while at != start {
                at = next[&at];
                steps += 1;
            }
            assert_eq!(steps, links.len(), "vertex {vertex} joins several discs");
        }
    }

    #[test]
    fn any_field_gives_a_closed_manifold() {
        // Random signs produce all 256 cells next to every kind of neighbor.
        let mut rng = rng(8);
        let mut seen = HashSet::new();
        for size in [5, 6, 12, 24] {
            let random = grid(size, |i, j, k| {
                let border = [i, j, k].iter().any(|n| *n == 0 || *n == size - 1);
                if border {
                    1.0
                } else {
                    rng.random::<f32>() - 0.5
                }
            });
            for k in 0..size - 1 {
                for j in 0..size - 1 {
                    for i in 0..size - 1 {
                        let value = |c: usize| {
                            random.values[random.index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2))]
                        };
                        seen.insert(
                            (0..8)
                                .filter(|c| value(*c) < 0.0)
                                .fold(0, |bits, c| bits | 1 << c),
                        );
                    }
                }
            }
            assert_manifold(&random.surface().unwrap());
        }
        assert_eq!(seen.len(), 256);
    }

    #[test]
    fn a_sampled_sphere_is_a_sphere() {
        let center = 0.10203;
        let sphere = grid(22, |i, j, k| {
            let to = |n: usize| 0.01 * n as f32 - center;
            (to(i).powi(2) + to(j).powi(2) + to(k).powi(2)).sqrt() - 0.08
        });
        let mesh = sphere.surface().unwrap();
        assert_eq!(mesh.facing(), Facing::Outward);
        assert_manifold(&mesh);
        for p in mesh.vertices() {
            let radius = (p - Point3::new(center, center, center)).norm();
            assert!((radius - 0.08).abs() < 2e-4, "{radius}");
        }
    }

    #[test]
    fn a_field_without_surface_and_wrong_counts_are_refused() {
        assert!(matches!(
            grid(4, |_, _, _| 1.0).surface(),
            Err(SimError::Mesh(_))
        ));
        let mut short = grid(4, |_, _, _| 1.0);
        short.values.pop();
        assert!(matches!(short.surface(), Err(SimError::VolumeSize { .. })));
    }
}
