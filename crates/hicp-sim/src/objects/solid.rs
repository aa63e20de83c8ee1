//! Closed triangle meshes from profiles and polygons.
//!
//! Every builder creates a closed, outward-facing part in meters. A [`Solid`] is a collection of
//! parts, which may overlap.

use std::collections::HashMap;

use hicp_core::internal::index;
use hicp_core::{Isometry3, MeshError, Point3, TriMesh, Vector3};

/// A collection of closed parts, in meters.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    vertices: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
}

impl Solid {
    /// Creates a solid without parts.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds every part of another solid, moved by `pose`.
    #[must_use]
    pub fn with(mut self, other: &Self, pose: &Isometry3<f64>) -> Self {
        let offset = index(self.vertices.len());
        self.vertices
            .extend(other.vertices.iter().map(|p| pose * p));
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|i| i + offset)));
        self
    }

    /// Returns the solid moved by `pose`.
    #[must_use]
    pub fn moved(mut self, pose: &Isometry3<f64>) -> Self {
        for p in &mut self.vertices {
            *p = pose * *p;
        }
        self
    }

    /// Returns the solid scaled along the axes by positive factors.
    #[must_use]
    pub fn scaled(mut self, factors: &Vector3<f64>) -> Self {
        for p in &mut self.vertices {
            p.coords.component_mul_assign(factors);
        }
        self
    }

    /// Converts the solid to a mesh. Corners at the same position become one vertex.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if there is no part, or if its sizes are not finite.
    pub fn to_mesh(&self) -> Result<TriMesh, MeshError> {
        let mut first_at: HashMap<[u32; 3], u32> = HashMap::with_capacity(self.vertices.len());
        let mut vertices: Vec<Point3<f32>> = Vec::new();
        let index_of: Vec<u32> = self
            .vertices
            .iter()
            .map(|p| {
                // Adding 0 turns -0 into +0.
                let p = p.cast::<f32>().map(|x| x + 0.0);
                let key = [p.x, p.y, p.z].map(f32::to_bits);
                *first_at.entry(key).or_insert_with(|| {
                    vertices.push(p);
                    index(vertices.len() - 1)
                })
            })
            .collect();
        let triangles = self
            .triangles
            .iter()
            .map(|corners| corners.map(|i| index_of[i as usize]))
            .collect();
        TriMesh::new(vertices, triangles)
    }

    /// Creates a cuboid centered at the origin with the given side lengths in meters.
    ///
    /// Each face is divided into `divisions`² cells.
    #[must_use]
    pub fn cuboid(sides: Vector3<f64>, divisions: usize) -> Self {
        let mut solid = Self::new();
        let half = sides / 2.0;
        // Each face has an outward axis and two in-plane axes with axis = first × second.
        for (axis, first, second) in [
            (Vector3::x(), Vector3::y(), Vector3::z()),
            (Vector3::y(), Vector3::z(), Vector3::x()),
            (Vector3::z(), Vector3::x(), Vector3::y()),
            (-Vector3::x(), Vector3::z(), Vector3::y()),
            (-Vector3::y(), Vector3::x(), Vector3::z()),
            (-Vector3::z(), Vector3::y(), Vector3::x()),
        ] {
            let corner = |i: usize, j: usize| {
                let at = |k: usize| 2.0 * k as f64 / divisions as f64 - 1.0;
                Point3::from((axis + first * at(i) + second * at(j)).component_mul(&half))
            };
            solid.grid(divisions, divisions, corner);
        }
        solid
    }

    /// Rotates a closed profile of (radius, height) points around the z axis.
    ///
    /// With the radius to the right and the height up, the profile is counter-clockwise around the
    /// material. Points of radius 0 lie on the axis. `steps` is the number of segments around the
    /// axis.
    #[must_use]
    pub fn lathe(profile: &[(f64, f64)], steps: usize) -> Self {
        Self::lathe_shaped(profile, steps, |_| 1.0)
    }

    /// Rotates a closed profile around the z axis, with every radius multiplied by `shape(angle)`.
    ///
    /// Apart from the factor, it does the same as [`Solid::lathe`]. `shape` is a positive function
    /// of the angle in radians, 0 to 2π, such as that of a hexagon.
    #[must_use]
    pub fn lathe_shaped(profile: &[(f64, f64)], steps: usize, shape: impl Fn(f64) -> f64) -> Self {
        let mut solid = Self::new();
        let angle = |j: usize| std::f64::consts::TAU * (j % steps) as f64 / steps as f64;
        for (i, &from) in profile.iter().enumerate() {
            let to = profile[(i + 1) % profile.len()];
            if from.0 == 0.0 && to.0 == 0.0 {
                continue;
            }
            let point = |end: usize, j: usize| {
                let (r, z) = if end == 0 { from } else { to };
                let (s, c) = angle(j).sin_cos();
                let r = r * shape(angle(j));
                Point3::new(r * c, r * s, z)
            };
            solid.grid(1, steps, |end, j| point(1 - end, j));
        }
        solid
    }

    /// Extrudes a simple polygon from z = −height/2 to height/2.
    ///
    /// The polygon is counter-clockwise in x and y and star-shaped around `kernel`. `layers` is the
    /// number of segments along z.
    #[must_use]
    pub fn prism(polygon: &[(f64, f64)], kernel: (f64, f64), height: f64, layers: usize) -> Self {
        let mut solid = Self::new();
        let n = polygon.len();
        let z = |layer: usize| height * (layer as f64 / layers as f64 - 0.5);
        let point = |i: usize, layer: usize| {
            let (x, y) = polygon[i % n];
            Point3::new(x, y, z(layer))
        };
        for i in 0..n {
            solid.grid(1, layers, |end, layer| point(i + end, layer));
            let (top, bottom) = (
                Point3::new(kernel.0, kernel.1, z(layers)),
                Point3::new(kernel.0, kernel.1, z(0)),
            );
            solid.triangle([top, point(i, layers), point(i + 1, layers)]);
            solid.triangle([bottom, point(i + 1, 0), point(i, 0)]);
        }
        solid
    }

    /// Sweeps a circle of radius `tube` along a path and closes both ends with flat caps.
    ///
    /// Lengths are in meters. The path has at least two different points, and no part of it runs
    /// along the y axis. `steps` is the number of segments of the circle.
    ///
    /// # Panics
    ///
    /// Panics if the path is empty.
    #[must_use]
    pub fn sweep(path: &[Point3<f64>], tube: f64, steps: usize) -> Self {
        let mut solid = Self::new();
        let last = path.len() - 1;
        let ring = |i: usize, j: usize| {
            let tangent = (path[(i + 1).min(last)] - path[i.saturating_sub(1)]).normalize();
            // No path in this crate runs along this axis.
            let side = tangent.cross(&Vector3::y()).normalize();
            let up = side.cross(&tangent);
            let (s, c) = (std::f64::consts::TAU * (j % steps) as f64 / steps as f64).sin_cos();
            path[i] + (side * c + up * s) * tube
        };
        solid.grid(last, steps, ring);
        for j in 0..steps {
            solid.triangle([path[0], ring(0, j), ring(0, j + 1)]);
            solid.triangle([path[last], ring(last, j + 1), ring(last, j)]);
        }
        solid
    }

    /// Adds a grid of quads. With i to the right and j up, the outside faces the viewer.
    fn grid(&mut self, n_i: usize, n_j: usize, point: impl Fn(usize, usize) -> Point3<f64>) {
        for i in 0..n_i {
            for j in 0..n_j {
                let corners = [
                    point(i, j),
                    point(i + 1, j),
                    point(i + 1, j + 1),
                    point(i, j + 1),
                ];
                self.triangle([corners[0], corners[1], corners[2]]);
                self.triangle([corners[0], corners[2], corners[3]]);
            }
        }
    }

    /// Adds a triangle unless two of its corners coincide, as on the axis of a lathe.
    fn triangle(&mut self, corners: [Point3<f64>; 3]) {
        let [a, b, c] = corners.map(|p| p.cast::<f32>());
        if a == b || b == c || c == a {
            return;
        }
        let first = index(self.vertices.len());
        self.vertices.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hicp_core::Facing;

    fn facing(solid: &Solid) -> Facing {
        solid.to_mesh().unwrap().facing()
    }

    #[test]
    fn every_builder_creates_a_closed_outward_part() {
        let cuboid = Solid::cuboid(Vector3::new(0.1, 0.2, 0.3), 3);
        assert_eq!(facing(&cuboid), Facing::Outward, "cuboid");
        let cylinder = Solid::lathe(&[(0.0, 0.0), (0.1, 0.0), (0.1, 0.2), (0.0, 0.2)], 12);
        assert_eq!(facing(&cylinder), Facing::Outward, "lathe");
        let square = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)];
        let prism = Solid::prism(&square, (0.05, 0.05), 0.2, 2);
        assert_eq!(facing(&prism), Facing::Outward, "prism");
        let path: Vec<_> = (0..5)
            .map(|i| Point3::new(0.05 * f64::from(i), 0.0, 0.01))
            .collect();
        let rod = Solid::sweep(&path, 0.01, 8);
        assert_eq!(facing(&rod), Facing::Outward, "sweep");
    }

    #[test]
    fn areas_match_those_of_the_shapes() {
        let mesh = Solid::cuboid(Vector3::new(0.1, 0.2, 0.3), 4)
            .to_mesh()
            .unwrap();
        assert!((mesh.area() - 2.0 * (0.02 + 0.03 + 0.06)).abs() < 1e-6);
        let cylinder = Solid::lathe(&[(0.0, 0.0), (0.1, 0.0), (0.1, 0.2), (0.0, 0.2)], 400);
        let exact = std::f64::consts::TAU * (0.1 * 0.2 + 0.1 * 0.1);
        assert!((cylinder.to_mesh().unwrap().area() - exact).abs() < 1e-4 * exact);
    }
}
