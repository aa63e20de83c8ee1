//! Dense meshes with fewer triangles.

use std::collections::HashMap;

use nalgebra::{Matrix3, Point3, Vector3};

use crate::internal::bounds;
use crate::object::mesh::{TriMesh, welded_triangles};

/// Approximate number of triangles of a simplified mesh.
const TRIANGLES: f64 = 12_000.0;
/// Smallest number of cells along the diagonal of the bounding box, also if a mesh has much surface
/// inside.
const CELLS: f64 = 30.0;
/// Weight of the mean of the vertices, relative to the planes around them. It decides where the
/// planes leave a direction free.
const OF_MEAN: f64 = 1e-3;

/// Returns a mesh of about 12,000 triangles whose renders hardly differ from those of a dense one.
///
/// Vertices in a cell of a cubic grid become one if their normals have the same longest component,
/// so that two sides of a wall stay apart. The new vertex lies where the squared distances from the
/// planes of their triangles are least, so that edges stay sharp (quadric clustering, Lindstrom
/// 2000).
///
/// Colors are lost. Returns `None` if less than half of the triangles would go.
///
/// Cost: O(triangles).
pub(crate) fn simplified(mesh: &TriMesh) -> Option<TriMesh> {
    let triangles = welded_triangles(mesh);
    let corners = |triangle: &[u32; 3]| {
        let points = triangle.map(|i| mesh.vertices()[i as usize].cast::<f64>());
        let [a, b, c] = points;
        (points, (b - a).cross(&(c - a)))
    };
    // Weighted by the area.
    let mut normals = vec![Vector3::zeros(); mesh.vertices().len()];
    for triangle in &triangles {
        let (_, normal) = corners(triangle);
        triangle.iter().for_each(|i| normals[*i as usize] += normal);
    }
    // A surface has about 3 triangles per cell of the grid that it meets.
    let [low, high] = bounds(mesh.used_points())?;
    let most = f64::from((high - low).norm()) / CELLS;
    let cell = (3.0 * mesh.area() / TRIANGLES).sqrt().min(most);
    let mut ids = HashMap::new();
    let mut clusters: Vec<Cluster> = Vec::new();
    let mut of_vertex = vec![usize::MAX; mesh.vertices().len()];
    for vertex in triangles.iter().flatten().map(|i| *i as usize) {
        if of_vertex[vertex] != usize::MAX {
            continue;
        }
        let point = mesh.vertices()[vertex].cast::<f64>();
        let axis = normals[vertex].iamax();
        let side = (axis, normals[vertex][axis] > 0.0);
        let place = point.coords.map(|x| ((x / cell).floor() + 0.0).to_bits());
        let id = *ids
            .entry((place.x, place.y, place.z, side))
            .or_insert_with(|| {
                clusters.push(Cluster::default());
                clusters.len() - 1
            });
        clusters[id].vertices += 1.0;
        clusters[id].sum += point.coords;
        of_vertex[vertex] = id;
    }
    for triangle in &triangles {
        let (points, normal) = corners(triangle);
        let area = normal.norm();
        if area > 0.0 {
            for (vertex, point) in triangle.iter().zip(points) {
                clusters[of_vertex[*vertex as usize]].add(&(normal / area), area, &point);
            }
        }
    }
    let vertices = clusters.iter().map(|cluster| cluster.place(cell)).collect();
    #[allow(clippy::cast_possible_truncation)] // There are fewer clusters than vertices.
    let triangles: Vec<[u32; 3]> = (triangles.iter())
        .map(|triangle| triangle.map(|vertex| of_vertex[vertex as usize] as u32))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    if triangles.len() > mesh.triangles().len() / 2 {
        return None;
    }
    let simple = TriMesh::new(vertices, triangles).ok()?;
    // Merging vertices leaves a closed surface closed, but more than two triangles may then meet at
    // an edge, so that the mesh itself would not tell.
    Some(simple.with_facing(mesh.facing()))
}

/// The vertices that become one.
#[derive(Default)]
struct Cluster {
    vertices: f64,
    sum: Vector3<f64>,
    /// The squared distance of a point x from the planes is xᵀAx − 2bᵀx + c, relative to the mean.
    a: Matrix3<f64>,
    b: Vector3<f64>,
}

impl Cluster {
    fn mean(&self) -> Vector3<f64> {
        self.sum / self.vertices.max(1.0)
    }

    /// Adds the plane of a triangle through a point.
    fn add(&mut self, normal: &Vector3<f64>, area: f64, point: &Point3<f64>) {
        let distance = normal.dot(&(point.coords - self.mean()));
        self.a += area * normal * normal.transpose();
        self.b += area * distance * normal;
    }

    /// Returns the point nearest to the planes, at most a cell from the mean.
    fn place(&self, cell: f64) -> Point3<f32> {
        let weight = OF_MEAN * self.a.trace();
        let inverse = (self.a + Matrix3::from_diagonal_element(weight)).try_inverse();
        let offset = inverse.map_or_else(Vector3::zeros, |inverse| inverse * self.b);
        let offset = offset.cap_magnitude(cell);
        Point3::from((self.mean() + offset).cast::<f32>())
    }
}
