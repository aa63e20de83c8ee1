//! Writing of meshes.

use std::path::Path;

use hicp_core::{Point3, TriMesh};

use super::ply;
use crate::atomic::write_atomically;
use crate::error::IoError;
use crate::unit::LengthUnit;

/// Writes a mesh as binary little-endian PLY with coordinates in `unit`.
///
/// In meters, the coordinates are written exactly. Colors are not written.
///
/// # Errors
///
/// As for [`write_atomically`].
pub fn write_ply(path: impl AsRef<Path>, mesh: &TriMesh, unit: LengthUnit) -> Result<(), IoError> {
    let vertices = mesh.vertices().iter().map(|v| in_unit(v, unit).into());
    ply::write::<3>(path.as_ref(), unit, vertices, Some(mesh.triangles()))
}

/// Writes a mesh as OBJ with coordinates in `unit`.
///
/// In meters, the coordinates are read back exactly. Colors are not written.
///
/// # Errors
///
/// As for [`write_atomically`].
pub fn write_obj(path: impl AsRef<Path>, mesh: &TriMesh, unit: LengthUnit) -> Result<(), IoError> {
    write_atomically(path, |writer| {
        writeln!(writer, "# units {unit}")?;
        for vertex in mesh.vertices() {
            let p = in_unit(vertex, unit);
            writeln!(writer, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for [a, b, c] in mesh.triangles() {
            writeln!(writer, "f {} {} {}", a + 1, b + 1, c + 1)?;
        }
        Ok(())
    })
}

fn in_unit(vertex: &Point3<f32>, unit: LengthUnit) -> Point3<f32> {
    (vertex.cast::<f64>() * unit.units_per_meter()).cast::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_mesh;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn meshes_survive_writing_and_reading(
            coordinates in prop::collection::vec(prop::array::uniform3(-2.0_f32..2.0), 3..30),
        ) {
            let vertices: Vec<_> = coordinates.iter().map(|c| Point3::from(*c)).collect();
            let n = u32::try_from(vertices.len()).unwrap();
            let triangles: Vec<_> = (0..n).map(|i| [i, (i + 1) % n, (i + 2) % n]).collect();
            let mesh = TriMesh::new(vertices, triangles).unwrap();
            let dir = tempfile::tempdir().unwrap();
            for unit in [LengthUnit::Meters, LengthUnit::Millimeters, LengthUnit::Centimeters] {
                for name in ["a.ply", "a.obj"] {
                    let path = dir.path().join(name);
                    match name {
                        "a.ply" => write_ply(&path, &mesh, unit).unwrap(),
                        _ => write_obj(&path, &mesh, unit).unwrap(),
                    }
                    let back = read_mesh(&path, unit).unwrap();
                    prop_assert_eq!(back.triangles(), mesh.triangles());
                    for (a, b) in back.vertices().iter().zip(mesh.vertices()) {
                        let error = (a - b).amax();
                        let tolerance = if unit == LengthUnit::Meters { 0.0 } else { 2e-7 };
                        prop_assert!(error <= tolerance, "{} {}", a, b);
                    }
                }
            }
        }
    }
}
