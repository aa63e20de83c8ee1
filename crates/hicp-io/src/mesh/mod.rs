//! Reading of meshes as GLB, glTF, OBJ, OFF, PLY and STL files, and writing.

use std::path::Path;

use hicp_core::TriMesh;

use crate::error::IoError;
use crate::format::{self, Format};
use crate::limits::ReadLimits;
use crate::source::read_head;
use crate::unit::LengthUnit;

mod colors;
mod gltf;
mod lines;
mod materials;
mod obj;
mod off;
pub(crate) mod ply;
mod polygon;
pub(crate) mod raw;
mod stl;
mod texture;
mod write;

use raw::{RawMesh, Reading};
pub use write::{write_obj, write_ply};

/// Reads a triangle mesh; the extension selects the format.
///
/// The extension is `.glb`, `.gltf`, `.obj`, `.off`, `.ply` or `.stl`, in upper or lower case.
/// Normals, lines and points are skipped. All objects and groups of a file become one mesh.
/// Polygons are triangulated, concave ones by ear clipping.
///
/// Coordinates are converted from `unit` to meters in `f64` and then rounded to `f32`. Binary STL
/// files already hold `f32`.
///
/// - GLB and glTF: triangles, strips and fans of the default scene, with the transforms of its
///   nodes; also quantized and sparse. The unit of the format is the meter, so pass
///   [`LengthUnit::Meters`]. Its y axis is up, and the axes stay. Draco and meshopt compression,
///   skins, morphed shapes, and unknown extensions that a file requires are refused. Buffers are
///   read from files next to it. The color is the base color of the materials, times their textures
///   or `COLOR_0`.
/// - OBJ: relative indices, continued lines, comments after a record and any line ending are
///   accepted. Vertices that no face uses are dropped. The color is `map_Kd` or `Kd` of the
///   materials; without materials, that of the vertices (`v x y z red green blue`).
/// - OFF: text with or without normals and colors, with comments. The counts may be on the first or
///   the second line.
/// - PLY: ASCII and binary of either byte order. Coordinates and faces may have any type of
///   numbers. The list of a face is `vertex_indices` or `vertex_index`. Vertices may have the color
///   `red`, `green` and `blue` (also `diffuse_red` …) as bytes, as numbers up to 1, or as 16-bit
///   numbers. Textures are those of comments `TextureFile`, with the coordinates `texture_u` and
///   `texture_v` of vertices (also `s` and `t`, `u` and `v`) or `texcoord` of faces.
/// - STL: ASCII with any number of solids, and binary, also if the header starts with `solid`.
///   Vertices at equal positions become one.
///
/// Textures and material files are read from the folder of the mesh or below it. Textures are PNG
/// or JPEG images, and all together have at most [`ReadLimits::max_pixels`] pixels. Colors never
/// make a file unreadable: if they cannot be used, the mesh has none
/// ([`ReadLimits::read_mesh_file`] returns the reason). [`ReadLimits::read_mesh_geometry`] skips
/// them.
///
/// Cost: the whole file and a small multiple of it are in memory while it is parsed, within
/// [`ReadLimits::DEFAULT`].
/// [`ReadLimits::read_mesh`] reads within other limits.
///
/// # Errors
///
/// [`IoError`] names the file and the place of the fault. The faults are:
///
/// - The file is not a regular file, is above a limit, or has an unknown extension.
/// - The first bytes show another format than the extension.
/// - The text is UTF-16 or UTF-32.
/// - The file is malformed or truncated, or its header announces more data than the file holds.
/// - The file has no faces, or a face refers to a vertex that does not exist.
/// - A coordinate is not finite or exceeds `hicp_core::MAX_COORDINATE_METERS`.
/// - Concave polygons take more than about a second to triangulate, typically with several thousand
///   corners or more.
/// - [`TriMesh::new`] refuses the mesh.
pub fn read_mesh(path: impl AsRef<Path>, unit: LengthUnit) -> Result<TriMesh, IoError> {
    ReadLimits::DEFAULT.read_mesh(path, unit)
}

/// A mesh, and the reason if the colors in its file cannot be used.
#[derive(Debug)]
pub struct MeshFile {
    /// The mesh, with its colors if they can be used.
    pub mesh: TriMesh,
    /// The reason why the colors of the file cannot be used. `None` if they are in the mesh, or if
    /// the file states none.
    pub color_fault: Option<IoError>,
}

impl ReadLimits {
    /// Reads a file as [`read_mesh`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_mesh`].
    pub fn read_mesh(&self, path: impl AsRef<Path>, unit: LengthUnit) -> Result<TriMesh, IoError> {
        self.read_mesh_file(path, unit).map(|file| file.mesh)
    }

    /// Reads a file as [`read_mesh`] does, and also returns why its colors cannot be used.
    ///
    /// # Errors
    ///
    /// As for [`read_mesh`].
    pub fn read_mesh_file(
        &self,
        path: impl AsRef<Path>,
        unit: LengthUnit,
    ) -> Result<MeshFile, IoError> {
        self.parse_mesh(path.as_ref(), unit, true)
    }

    /// Reads a file as [`read_mesh`] does, but without its colors: neither materials nor textures
    /// are opened.
    ///
    /// # Errors
    ///
    /// As for [`read_mesh`].
    pub fn read_mesh_geometry(
        &self,
        path: impl AsRef<Path>,
        unit: LengthUnit,
    ) -> Result<TriMesh, IoError> {
        let file = self.parse_mesh(path.as_ref(), unit, false)?;
        Ok(file.mesh)
    }

    fn parse_mesh(
        &self,
        path: &Path,
        unit: LengthUnit,
        with_color: bool,
    ) -> Result<MeshFile, IoError> {
        let extension = path
            .extension()
            .unwrap_or_default()
            .to_string_lossy()
            .to_lowercase();
        let (check_head, parse): (CheckHead, Parse) = match extension.as_str() {
            "glb" | "gltf" => (|_, _, _| Ok(()), gltf::parse),
            "obj" => (|_, _, _| Ok(()), obj::parse),
            "off" => (|_, _, _| Ok(()), off::parse),
            "ply" => (ply::check_head, ply::parse_mesh),
            "stl" => (stl::check_head, stl::parse),
            _ => {
                if let Ok((head, _)) = read_head(path) {
                    check_format(path, &extension, &head)?;
                }
                let found = match path.is_dir() {
                    true => "a folder".to_owned(),
                    false => format!("a file with the extension {extension:?}"),
                };
                return Err(IoError::new(path, None, found, EXTENSIONS));
            }
        };
        let reading = Reading {
            path,
            unit,
            limits: self,
            with_color,
        };
        // Check counts from the first bytes, to refuse a large file before reading all of it.
        let (head, bytes) = read_head(path)?;
        check_format(path, &extension, &head)?;
        check_head(&reading, &head, bytes)?;
        let (mesh, color_fault) = parse(reading, self.read_bytes(path)?)?.finish()?;
        Ok(MeshFile { mesh, color_fault })
    }
}

/// The extensions of the supported formats.
const EXTENSIONS: &str = ".glb, .gltf, .obj, .off, .ply or .stl";

/// Returns an error if the first bytes show another format than the extension.
///
/// The header of a binary STL file may start with any bytes, so only long signatures count.
fn check_format(path: &Path, extension: &str, head: &[u8]) -> Result<(), IoError> {
    use Format::{Exr, Glb, Gzip, Hdf5, Jpeg, Npy, Npz, Pcd, Ply, Png, Tiff};
    let wanted = match Format::of(head) {
        Some(Glb) if !extension.starts_with("gl") => ": rename it to .glb",
        Some(Ply) if extension != "ply" && head.trim_ascii_start().starts_with(b"ply\n") => {
            ": rename it to .ply"
        }
        Some(Pcd) => ": a cloud has no faces; make a surface first",
        Some(Exr | Gzip | Hdf5 | Jpeg | Npy | Npz | Png | Tiff) => "",
        _ => return Ok(()),
    };
    let expected = format!("a mesh named {EXTENSIONS}{wanted}");
    Err(format::refuse(path, head, &expected))
}

type CheckHead = fn(&Reading<'_>, &[u8], u64) -> Result<(), IoError>;
type Parse = for<'a> fn(Reading<'a>, Vec<u8>) -> Result<RawMesh<'a>, IoError>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Place;
    use hicp_core::Point3;

    /// The context that the tests of the parsers read with.
    pub(super) fn reading(name: &'static str) -> Reading<'static> {
        Reading {
            path: Path::new(name),
            unit: LengthUnit::Meters,
            limits: &ReadLimits::DEFAULT,
            with_color: true,
        }
    }

    #[test]
    fn errors_name_an_unknown_extension() {
        for (name, extension) in [("mesh.DAE", "dae"), ("mesh.ply.gz", "gz"), ("mesh", "")] {
            match read_mesh(name, LengthUnit::Meters) {
                Err(IoError {
                    found, expected, ..
                }) => {
                    assert_eq!(found, format!("a file with the extension {extension:?}"));
                    assert_eq!(expected, EXTENSIONS);
                }
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
    fn an_error_names_the_line_of_a_concave_polygon_beyond_the_budget() {
        let reading = reading("a.obj");
        let mut mesh = RawMesh::new(reading, reading.refuse(Place::Line(1), "", ""));
        let dart = [[2.0, 1.0], [0.0, 2.0], [1.0, 1.0], [0.0, 0.0]];
        mesh.vertices = dart.map(|p| Point3::new(p[0], p[1], 0.0)).to_vec();
        for spent in [false, true] {
            if spent {
                mesh.clipping_budget = 0;
            }
            let convex = mesh.add_face(Place::Line(7), &[0, 1, 3]);
            assert!(convex.is_ok());
            let concave = mesh.add_face(Place::Line(8), &[0, 1, 2, 3]);
            match (spent, concave) {
                (false, Ok(())) => {}
                (
                    true,
                    Err(IoError {
                        found,
                        place: Some(Place::Line(line)),
                        ..
                    }),
                ) => {
                    assert_eq!(
                        (line, found.as_str()),
                        (8, "a concave polygon of 4 corners")
                    );
                }
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn the_error_for_a_mesh_without_area_states_the_expectation() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.obj");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nf 1 2 2\n").unwrap();
        let error = read_mesh(&path, LengthUnit::Meters).unwrap_err();
        let message = error.to_string();
        assert!(
            message.ends_with("mesh, expected a triangle that has an area"),
            "{message}"
        );
    }

    #[test]
    fn the_error_for_a_missing_file_names_it() {
        let error = read_mesh("no/such/file.ply", LengthUnit::Meters).unwrap_err();
        assert_eq!(error.to_string(), "cannot read no/such/file.ply");
    }
}
