//! Defects of a mesh that do not prevent its use.

use std::collections::HashSet;

use crate::internal::DisjointSets;
use crate::object::mesh::{TriMesh, edge_uses, welded_triangles};

/// Counts of defects of a mesh. Except for `components`, all are 0 for a clean closed mesh.
///
/// Vertices at equal positions count as one in edges and parts, so that seams of texture
/// coordinates and repeated vertices are not defects. Triangles with two corners at one position
/// belong to neither.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct MeshSurvey {
    /// Triangles of zero area.
    pub degenerate_triangles: usize,
    /// Triangles over the same three positions as an earlier one, in any order.
    pub duplicate_triangles: usize,
    /// Vertices that no triangle uses.
    pub unused_vertices: usize,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Edges with two triangles that use it in the same direction, so that one of them is flipped.
    pub misoriented_edges: usize,
    /// Parts that share no vertex.
    pub components: usize,
}

impl MeshSurvey {
    /// Returns whether every edge has two triangles. Unlike [`TriMesh::is_closed`], it ignores the
    /// winding.
    #[must_use]
    pub fn is_watertight(&self) -> bool {
        self.boundary_edges == 0 && self.non_manifold_edges == 0 && self.components > 0
    }
}

impl TriMesh {
    /// Counts the defects of the mesh.
    ///
    /// Cost: O(triangles), with about a hundred bytes of memory for each.
    ///
    /// ```
    /// use hicp_core::{Point3, TriMesh};
    /// # fn main() -> Result<(), hicp_core::MeshError> {
    /// let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]].map(Point3::from);
    /// let survey = TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?.survey();
    /// assert_eq!((survey.boundary_edges, survey.components), (3, 1));
    /// assert!(!survey.is_watertight());
    /// # Ok(()) }
    /// ```
    #[must_use]
    pub fn survey(&self) -> MeshSurvey {
        let triangles = welded_triangles(self);
        let edges = edge_uses(&triangles);
        let count = |matches: fn(&[u32; 2]) -> bool| edges.values().filter(|e| matches(e)).count();
        let sorted = |mut corners: [u32; 3]| {
            corners.sort_unstable();
            corners
        };
        let distinct: HashSet<[u32; 3]> = triangles.iter().copied().map(sorted).collect();
        let mut parts = DisjointSets::of(self.vertices().len(), &triangles);
        let first = triangles.iter().map(|[a, ..]| *a as usize);
        let roots: HashSet<usize> = first.map(|vertex| parts.find(vertex)).collect();
        let areas = (0..self.triangles().len()).map(|triangle| self.triangle_area(triangle));
        MeshSurvey {
            degenerate_triangles: areas.filter(|area| *area <= 0.0).count(),
            duplicate_triangles: triangles.len() - distinct.len(),
            unused_vertices: self.used_vertices().iter().filter(|used| !**used).count(),
            boundary_edges: count(|uses| uses[0] + uses[1] == 1),
            non_manifold_edges: count(|uses| uses[0] + uses[1] > 2),
            misoriented_edges: count(|uses| matches!(uses, [2, 0] | [0, 2])),
            components: roots.len(),
        }
    }
}
