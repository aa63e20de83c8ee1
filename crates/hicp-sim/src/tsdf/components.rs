//! Connected components of a mesh.

use hicp_core::internal::{DisjointSets, index};
use hicp_core::{MeshError, Point3, TriMesh};

/// A connected component of a mesh.
#[derive(Clone, Debug)]
pub struct Component {
    /// The component as a mesh of its own triangles.
    pub mesh: TriMesh,
    /// Its area, m².
    pub area: f64,
    /// The enclosed volume if the component is closed, m³.
    ///
    /// It is negative if the component faces inward, such as around a cavity.
    pub volume: f64,
}

/// Returns the components connected by shared vertices, the largest area first.
///
/// Cost: O(triangles).
///
/// # Errors
///
/// [`MeshError`] if a component has no area.
pub fn components(mesh: &TriMesh) -> Result<Vec<Component>, MeshError> {
    let mut parts = DisjointSets::of(mesh.vertices().len(), mesh.triangles());
    // Components are numbered by their first triangle.
    let mut number: Vec<Option<usize>> = vec![None; mesh.vertices().len()];
    let mut triangles: Vec<Vec<[u32; 3]>> = Vec::new();
    for corners in mesh.triangles() {
        let part = parts.find(corners[0] as usize);
        let number = *number[part].get_or_insert_with(|| {
            triangles.push(Vec::new());
            triangles.len() - 1
        });
        triangles[number].push(*corners);
    }
    let mut new_index: Vec<Option<u32>> = vec![None; mesh.vertices().len()];
    let mut components = Vec::with_capacity(triangles.len());
    for mut triangles in triangles {
        let mut vertices: Vec<Point3<f32>> = Vec::new();
        for corner in triangles.iter_mut().flatten() {
            let old = *corner as usize;
            *corner = *new_index[old].get_or_insert_with(|| {
                vertices.push(mesh.vertices()[old]);
                index(vertices.len() - 1)
            });
        }
        let mesh = TriMesh::new(vertices, triangles)?;
        components.push(Component {
            area: mesh.area(),
            volume: volume(&mesh),
            mesh,
        });
    }
    components.sort_by(|a, b| b.area.total_cmp(&a.area));
    Ok(components)
}

/// Joins meshes into one.
///
/// # Errors
///
/// [`MeshError`] if there is no mesh.
pub fn join<'a>(meshes: impl IntoIterator<Item = &'a TriMesh>) -> Result<TriMesh, MeshError> {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for mesh in meshes {
        let offset = index(vertices.len());
        vertices.extend_from_slice(mesh.vertices());
        let corners = mesh.triangles().iter();
        triangles.extend(corners.map(|corners| corners.map(|i| i + offset)));
    }
    TriMesh::new(vertices, triangles)
}

/// Returns the signed volume of a closed mesh, m³, as the sum over tetrahedra to one of its
/// vertices.
fn volume(mesh: &TriMesh) -> f64 {
    let origin = mesh.corners(0)[0].cast::<f64>();
    let tetrahedra = (0..mesh.triangles().len()).map(|t| {
        let [a, b, c] = mesh.corners(t).map(|p| p.cast::<f64>() - origin);
        a.dot(&b.cross(&c)) / 6.0
    });
    tetrahedra.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Solid;
    use hicp_core::{Isometry3, Vector3};

    #[test]
    fn components_are_separated_and_joined_again() {
        let (small, large) = (
            Solid::cuboid(Vector3::new(0.1, 0.1, 0.1), 2),
            Solid::cuboid(Vector3::new(0.1, 0.2, 0.3), 2),
        );
        let mesh = small
            .with(&large, &Isometry3::translation(1.0, 0.0, 0.0))
            .to_mesh()
            .unwrap();
        let parts = components(&mesh).unwrap();
        let volumes: Vec<f64> = parts.iter().map(|part| part.volume).collect();
        assert_eq!(volumes.len(), 2);
        assert!(
            (volumes[0] - 0.006).abs() < 1e-8 && (volumes[1] - 0.001).abs() < 1e-8,
            "{volumes:?}"
        );
        let joined = join(parts.iter().map(|part| &part.mesh)).unwrap();
        assert_eq!(joined.triangles().len(), mesh.triangles().len());
        assert!((joined.area() - mesh.area()).abs() < 1e-9);
        assert!(join([]).is_err());
    }
}
