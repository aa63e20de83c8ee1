//! Writing of PLY files.

use std::path::Path;

use super::header::VERTEX_NAMES;
use crate::atomic::write_atomically;
use crate::error::IoError;
use crate::unit::LengthUnit;

/// Writes a binary little-endian file.
///
/// The properties of a vertex are the first N of [`VERTEX_NAMES`].
pub(crate) fn write<const N: usize>(
    path: &Path,
    unit: LengthUnit,
    vertices: impl ExactSizeIterator<Item = [f32; N]>,
    triangles: Option<&[[u32; 3]]>,
) -> Result<(), IoError> {
    write_atomically(path, |writer| {
        writeln!(
            writer,
            "ply\nformat binary_little_endian 1.0\ncomment units {unit}"
        )?;
        writeln!(writer, "element vertex {}", vertices.len())?;
        for name in &VERTEX_NAMES[..N] {
            writeln!(writer, "property float {name}")?;
        }
        if let Some(triangles) = triangles {
            writeln!(writer, "element face {}", triangles.len())?;
            writeln!(writer, "property list uchar int vertex_indices")?;
        }
        writeln!(writer, "end_header")?;
        for number in vertices.flatten() {
            writer.write_all(&number.to_le_bytes())?;
        }
        for triangle in triangles.unwrap_or_default() {
            writer.write_all(&[3])?;
            // Core limits meshes to 50 million vertices, so a signed index has the same bytes.
            for index in triangle {
                writer.write_all(&index.to_le_bytes())?;
            }
        }
        Ok(())
    })
}
