//! Defects of a mesh that do not prevent its use.

use std::collections::{HashMap, HashSet};

use crate::object::mesh::{DisjointSets, TriMesh, weld};

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
        let welded = weld(self.vertices());
        let mut seen = HashSet::with_capacity(self.triangles().len());
        // For every edge, its uses in upward and in downward direction.
        let mut edges: HashMap<(u32, u32), [u32; 2]> = HashMap::new();
        let (mut degenerate, mut duplicate) = (0, 0);
        for (triangle, corners) in self.triangles().iter().enumerate() {
            let [a, b, c] = corners.map(|index| welded[index as usize]);
            degenerate += usize::from(self.triangle_area(triangle) <= 0.0);
            if a == b || b == c || c == a {
                continue;
            }
            let mut sorted = [a, b, c];
            sorted.sort_unstable();
            duplicate += usize::from(!seen.insert(sorted));
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let walks = edges.entry((from.min(to), from.max(to))).or_default();
                walks[usize::from(from > to)] += 1;
            }
        }
        let mut parts = DisjointSets::of(self.vertices().len(), &seen);
        let roots: HashSet<u32> = seen.iter().map(|corners| parts.find(corners[0])).collect();
        let count = |matches: fn(&[u32; 2]) -> bool| edges.values().filter(|e| matches(e)).count();
        MeshSurvey {
            degenerate_triangles: degenerate,
            duplicate_triangles: duplicate,
            unused_vertices: self.used_vertices().iter().filter(|used| !**used).count(),
            boundary_edges: count(|walks| walks[0] + walks[1] == 1),
            non_manifold_edges: count(|walks| walks[0] + walks[1] > 2),
            misoriented_edges: count(|walks| matches!(walks, [2, 0] | [0, 2])),
            components: roots.len(),
        }
    }
}
