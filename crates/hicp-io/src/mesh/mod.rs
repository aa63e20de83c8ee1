//! Meshes from and to OBJ, PLY and STL files.

use std::path::Path;

use hicp_core::{Point3, TriMesh};

use crate::error::IoError;
use crate::source::read_bytes;
use crate::unit::LengthUnit;

mod obj;
pub(crate) mod ply;
mod polygon;
mod stl;
mod write;

pub use write::{write_obj, write_ply};

const SUPPORTED: &str = ".obj, .ply or .stl";

/// Reads a triangle mesh; the extension tells the format, in either case: `.obj`, `.ply` or `.stl`.
///
/// Only geometry is read: materials, colours, normals and texture coordinates are skipped, lines and points too, and all
/// objects and groups of a file make one mesh. Polygons are triangulated, concave ones by ear clipping. Coordinates are
/// multiplied by `unit` in `f64` (STL files hold `f32`) and only then rounded to `f32`. The vertices of STL files are
/// welded where their positions are equal; in OBJ files vertices that no face uses are dropped.
///
/// - OBJ: relative indices, line continuations, comments after a record and any line ending are understood.
/// - PLY: ASCII and binary of either byte order, any numeric types, faces in `vertex_indices` or `vertex_index`.
/// - STL: ASCII with any number of solids, and binary, also where the header starts with `solid`.
///
/// Cost: the whole file is held in memory, and a small multiple of it while it is parsed.
///
/// # Errors
///
/// [`IoError`] that names the file and where in it the trouble is: a file above 4 GiB, an unknown extension, text that
/// is not UTF-8, a malformed or truncated file, a header that promises more than the file holds, a face whose vertex is
/// not there, and, as [`IoError::Mesh`], whatever [`TriMesh::new`] refuses (no faces, coordinates that are not finite).
pub fn read_mesh(path: impl AsRef<Path>, unit: LengthUnit) -> Result<TriMesh, IoError> {
    let path = path.as_ref();
    let extension = path
        .extension()
        .map(|extension| extension.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    let parse = match extension.as_str() {
        "obj" => obj::parse,
        "ply" => ply::parse_mesh,
        "stl" => stl::parse,
        _ => {
            return Err(IoError::Extension {
                path: path.to_owned(),
                found: extension,
                expected: SUPPORTED,
            });
        }
    };
    parse(path, read_bytes(path)?)?.finish(path, unit)
}

/// A mesh in the units of its file.
#[derive(Debug, Default)]
struct RawMesh {
    vertices: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
}

impl RawMesh {
    /// Adds a face. Its corners must be vertices that are there.
    fn add_face(&mut self, corners: &[u32]) {
        polygon::triangulate(&self.vertices, corners, &mut self.triangles);
    }

    fn finish(self, path: &Path, unit: LengthUnit) -> Result<TriMesh, IoError> {
        let scale = unit.units_per_meter();
        let vertices = self
            .vertices
            .iter()
            .map(|p| (p / scale).cast::<f32>())
            .collect();
        TriMesh::new(vertices, self.triangles).map_err(|e| IoError::mesh(path, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_extensions_are_refused_by_name() {
        for (name, extension) in [("mesh.OFF", "off"), ("mesh", "")] {
            match read_mesh(name, LengthUnit::Meters) {
                Err(IoError::Extension {
                    found, expected, ..
                }) => assert_eq!((found.as_str(), expected), (extension, SUPPORTED)),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn the_extension_may_be_in_capitals_and_the_unit_is_applied() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.OBJ");
        std::fs::write(&path, "v 0 0 0\nv 30 0 0\nv 0 40 0\nf 1 2 3").unwrap();
        for (unit, area) in [
            (LengthUnit::Meters, 600.0),
            (LengthUnit::Centimeters, 0.06),
            (LengthUnit::Millimeters, 0.0006),
        ] {
            let mesh = read_mesh(&path, unit).unwrap();
            assert!((mesh.area() / area - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = read_mesh("no/such/file.ply", LengthUnit::Meters).unwrap_err();
        assert_eq!(error.to_string(), "cannot read no/such/file.ply");
    }
}
