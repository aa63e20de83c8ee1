//! STL: binary through `stl_io`, ASCII here.
//!
//! ASCII files are read by their `vertex` lines alone. `stl_io` stops at the first `endsolid`, refuses `solid` without
//! a name and facet normals that are not finite, and parses in `f32`; all of these occur in files that people have.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;

use hicp_core::Point3;

use super::RawMesh;
use crate::error::{END_OF_FILE, IoError};
use crate::source::text_bytes;

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: u64 = 50;

/// Parses an STL file; vertices at the same position become one.
pub(super) fn parse(path: &Path, content: Vec<u8>) -> Result<RawMesh, IoError> {
    if is_ascii(&content) {
        parse_ascii(path, text_bytes(path, &content)?)
    } else {
        parse_binary(path, content)
    }
}

/// Decides by size first: many exporters start the header of binary files with `solid`.
fn is_ascii(content: &[u8]) -> bool {
    let fits_binary = triangle_count(content).is_some_and(|count| {
        content.len() as u64 == HEADER_BYTES as u64 + u64::from(count) * TRIANGLE_BYTES
    });
    let start = &content[..content.len().min(512)];
    !fits_binary && !start.contains(&0) && {
        let text = String::from_utf8_lossy(start);
        text.trim_start_matches('\u{feff}')
            .trim_start()
            .get(..5)
            .is_some_and(|word| word.eq_ignore_ascii_case("solid"))
    }
}

fn triangle_count(content: &[u8]) -> Option<u32> {
    let bytes = content.get(HEADER_BYTES - 4..HEADER_BYTES)?;
    Some(u32::from_le_bytes(bytes.try_into().ok()?))
}

fn parse_binary(path: &Path, mut content: Vec<u8>) -> Result<RawMesh, IoError> {
    let Some(count) = triangle_count(&content) else {
        return Err(IoError::Bytes {
            path: path.to_owned(),
            offset: content.len() as u64,
            found: END_OF_FILE.to_owned(),
            expected: "`solid`, or a binary header of 84 bytes".to_owned(),
        });
    };
    let (needed, available) = (
        u64::from(count) * TRIANGLE_BYTES,
        (content.len() - HEADER_BYTES) as u64,
    );
    if needed > available {
        return Err(IoError::Promise {
            path: path.to_owned(),
            what: "triangles".to_owned(),
            count: u64::from(count),
            needed,
            available,
        });
    }
    // The text of the header means nothing, but `stl_io` would take one that starts with `solid` for ASCII.
    content[..HEADER_BYTES - 4].fill(0);
    let mesh = stl_io::read_stl(&mut Cursor::new(content))
        .map_err(|source| IoError::read(path, source))?;
    let vertices = mesh
        .vertices
        .iter()
        .map(|p| Point3::new(p[0], p[1], p[2]).cast::<f64>())
        .collect();
    let mut raw = RawMesh {
        vertices,
        triangles: Vec::with_capacity(mesh.faces.len()),
    };
    for face in mesh.faces {
        // At most three vertices per triangle: their number fits 64 bits here and is checked against 32 by the mesh.
        let corners = face.vertices.map(|i| u32::try_from(i).unwrap_or(u32::MAX));
        raw.triangles.push(corners);
    }
    Ok(raw)
}

fn parse_ascii(path: &Path, content: &[u8]) -> Result<RawMesh, IoError> {
    let end_of_line = if content.contains(&b'\n') {
        b'\n'
    } else {
        b'\r'
    };
    let mut mesh = RawMesh::default();
    let mut welded: HashMap<[u64; 3], u32> = HashMap::new();
    let mut facet: Vec<u32> = Vec::with_capacity(3);
    let mut last_line = 0;
    for (number, line) in (1_usize..).zip(content.split(|byte| *byte == end_of_line)) {
        last_line = number;
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next().map(str::to_ascii_lowercase) else {
            continue;
        };
        match keyword.as_str() {
            "vertex" => {
                let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
                let [x, y, z] = numbers[..] else {
                    return Err(IoError::line(
                        path,
                        number,
                        &line,
                        "`vertex` and three numbers",
                    ));
                };
                let next = u32::try_from(mesh.vertices.len()).unwrap_or(u32::MAX);
                // Adding 0 turns −0 into +0.
                let key = [x, y, z].map(|value| (value + 0.0).to_bits());
                let index = *welded.entry(key).or_insert(next);
                if index == next {
                    mesh.vertices.push(Point3::new(x, y, z));
                }
                facet.push(index);
            }
            "endfacet" => {
                let [a, b, c] = facet[..] else {
                    let expected = format!("3 vertices before `endfacet`, not {}", facet.len());
                    return Err(IoError::line(path, number, &line, expected));
                };
                mesh.triangles.push([a, b, c]);
                facet.clear();
            }
            "solid" | "endsolid" | "facet" | "outer" | "endloop" => {}
            _ => {
                return Err(IoError::line(path, number, &line, "a keyword of ASCII STL"));
            }
        }
    }
    if facet.is_empty() {
        Ok(mesh)
    } else {
        Err(IoError::line(path, last_line, END_OF_FILE, "`endfacet`"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(content: &[u8]) -> Result<RawMesh, IoError> {
        parse(Path::new("a.stl"), content.to_vec())
    }

    fn binary(title: &[u8], count: u32, triangles: usize) -> Vec<u8> {
        let mut content = title.to_vec();
        content.resize(80, b' ');
        content.extend(count.to_le_bytes());
        for triangle in 0..triangles {
            for corner in 0..4_u8 {
                for axis in 0..3_u8 {
                    let value = if corner == axis + 1 {
                        1.0 + triangle as f32
                    } else {
                        0.0
                    };
                    content.extend(value.to_le_bytes());
                }
            }
            content.extend([0, 0]);
        }
        content
    }

    #[test]
    fn binary_files_by_size_whatever_the_header_says() {
        for title in [&b"solid but binary"[..], b"made by hand"] {
            let mesh = read(&binary(title, 2, 2)).unwrap();
            assert_eq!((mesh.triangles.len(), mesh.vertices.len()), (2, 6));
        }
        let mut trailing = binary(b"x", 1, 1);
        trailing.extend([1, 2, 3]);
        assert_eq!(read(&trailing).unwrap().triangles.len(), 1);
    }

    #[test]
    fn truncated_and_lying_binary_files_are_refused_before_reading() {
        let mut truncated = binary(b"solid", 2, 2);
        truncated.pop();
        for content in [truncated, binary(b"x", u32::MAX, 1)] {
            assert!(matches!(read(&content), Err(IoError::Promise { .. })));
        }
        for content in [&b""[..], b"abc", &[0; 83]] {
            assert!(matches!(read(content), Err(IoError::Bytes { .. })));
        }
    }

    const FACET: &str = "facet normal nan nan nan\nouter loop\nvertex 0 0 0\nvertex 1 0 -0.0\nvertex 0 1 0\nendloop\nendfacet\n";

    #[test]
    fn ascii_solids_are_merged_and_vertices_welded() {
        let text = format!("\u{feff}solid\n{FACET}endsolid\nSOLID b\nendsolid b\nsolid c\n{FACET}");
        let mesh = read(text.as_bytes()).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.vertices.len()), (2, 3));
    }

    #[test]
    fn ascii_errors_name_the_line() {
        for (from, to, at) in [
            ("vertex 1 0 -0.0", "vertex 1 0", 5),
            ("vertex 1 0 -0.0", "vertex 1 0 z", 5),
            ("vertex 1 0 -0.0", "vertex 1 0 0 0", 5),
            ("vertex 0 0 0\n", "", 7),
            ("outer loop", "inner loop", 3),
            ("endfacet\n", "", 8),
        ] {
            let text = format!("solid x\n{}", FACET.replacen(from, to, 1));
            match read(text.as_bytes()) {
                Err(IoError::Line { line, .. }) => assert_eq!(line, at, "{to}"),
                other => panic!("{to}: {other:?}"),
            }
        }
    }
}
