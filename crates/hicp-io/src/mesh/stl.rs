//! STL, ASCII and binary.
//!
//! Read here because readers at hand stop at the first `endsolid`, refuse `solid` without a name and facet normals that are
//! not finite, take binary files for text by the first word of their header, and do not say where a file is broken; all of
//! these occur in files that people have. Normals are not read: the winding says the same.

use super::weld::Welder;
use super::{RawMesh, Reading, line_end};
use crate::error::{END_OF_FILE, IoError, Place};
use crate::source::text_bytes;

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;
/// Where a binary file says how many triangles it has.
const COUNT: Place = Place::Byte(80);

/// Refuses a binary file by its header, when it has the triangles that it promises and they are too many.
pub(super) fn check_head(reading: &Reading<'_>, head: &[u8], bytes: u64) -> Result<(), IoError> {
    match triangle_count(head) {
        Some(count) if binary_bytes(count) == bytes => {
            reading.check_triangles(COUNT, count as usize)
        }
        _ => Ok(()),
    }
}

/// Parses an STL file; vertices at the same position become one.
pub(super) fn parse(reading: &Reading<'_>, content: Vec<u8>) -> Result<RawMesh, IoError> {
    if is_ascii(&content) {
        parse_ascii(reading, text_bytes(reading.path, &content)?)
    } else {
        text_bytes(reading.path, &content)?;
        parse_binary(reading, &content)
    }
}

/// Decides by size first: many exporters start the header of binary files with `solid`.
fn is_ascii(content: &[u8]) -> bool {
    let fits_binary =
        triangle_count(content).is_some_and(|count| binary_bytes(count) == content.len() as u64);
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

fn binary_bytes(count: u32) -> u64 {
    HEADER_BYTES as u64 + u64::from(count) * TRIANGLE_BYTES as u64
}

fn parse_binary(reading: &Reading<'_>, content: &[u8]) -> Result<RawMesh, IoError> {
    let end = Place::Byte(content.len() as u64);
    let Some(count) = triangle_count(content) else {
        return Err(IoError::at(
            reading.path,
            end,
            END_OF_FILE,
            "`solid`, or a binary header of 84 bytes",
        ));
    };
    let body = &content[HEADER_BYTES..];
    let needed = u64::from(count) * TRIANGLE_BYTES as u64;
    if needed > body.len() as u64 {
        return Err(IoError::Promise {
            path: reading.path.to_owned(),
            place: COUNT,
            what: "triangles".to_owned(),
            count: u64::from(count),
            needed,
            available: body.len() as u64,
        });
    }
    // A few bytes of padding are harmless; whole triangles that the header leaves out are not.
    let there = body.len() / TRIANGLE_BYTES;
    if there > count as usize {
        return Err(IoError::at(
            reading.path,
            COUNT,
            &format!("a count of {count} triangles"),
            format!("{there}, which the file has bytes for"),
        ));
    }
    reading.check_triangles(COUNT, there)?;
    let mut mesh = RawMesh::new(COUNT);
    mesh.triangles.reserve_exact(there);
    let mut welder = Welder::default();
    for (number, triangle) in body.chunks_exact(TRIANGLE_BYTES).enumerate() {
        let start = HEADER_BYTES + number * TRIANGLE_BYTES;
        let mut corners = [0; 3];
        // The normal comes first.
        for (corner, index) in corners.iter_mut().enumerate() {
            let at = 12 * (corner + 1);
            let mut position = [0.0; 3];
            for (value, bytes) in position.iter_mut().zip(triangle[at..].chunks_exact(4)) {
                *value = f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
            }
            let place = Place::Byte((start + at) as u64);
            reading.check_position(place, &position)?;
            *index = welder.index(position, &mut mesh.vertices);
            reading.check_vertices(place, mesh.vertices.len())?;
        }
        mesh.triangles.push(corners);
    }
    Ok(mesh)
}

fn parse_ascii(reading: &Reading<'_>, content: &[u8]) -> Result<RawMesh, IoError> {
    let path = reading.path;
    let mut mesh = RawMesh::new(Place::Line(1));
    let mut welder = Welder::default();
    let mut facet: Vec<u32> = Vec::with_capacity(3);
    let mut open = false;
    let line_end = line_end(content);
    for (number, line) in (1_usize..).zip(content.split(|byte| *byte == line_end)) {
        let place = Place::Line(number);
        mesh.end = place;
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next().map(str::to_ascii_lowercase) else {
            continue;
        };
        match keyword.as_str() {
            "vertex" => {
                let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
                let [x, y, z] = numbers[..] else {
                    let expected = "`vertex` and three numbers";
                    return Err(IoError::line(path, number, &line, expected));
                };
                reading.check_position(place, &[x, y, z])?;
                facet.push(welder.index([x, y, z], &mut mesh.vertices));
                reading.check_vertices(place, mesh.vertices.len())?;
            }
            "endfacet" => {
                let [a, b, c] = facet[..] else {
                    let expected = format!("3 vertices before `endfacet`, not {}", facet.len());
                    return Err(IoError::line(path, number, &line, expected));
                };
                mesh.triangles.push([a, b, c]);
                reading.check_triangles(place, mesh.triangles.len())?;
                facet.clear();
            }
            "solid" => open = true,
            "endsolid" => open = false,
            "facet" | "outer" | "endloop" => {}
            _ => {
                return Err(IoError::line(path, number, &line, "a keyword of ASCII STL"));
            }
        }
    }
    // Without its last line a file may have lost any number of facets.
    match (facet.is_empty(), open) {
        (false, _) => Err(IoError::at(path, mesh.end, END_OF_FILE, "`endfacet`")),
        (true, true) => Err(IoError::at(path, mesh.end, END_OF_FILE, "`endsolid`")),
        (true, false) => Ok(mesh),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::mesh::tests::reading;

    fn read(content: &[u8]) -> Result<RawMesh, IoError> {
        parse(&reading("a.stl"), content.to_vec())
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
        for content in [truncated, binary(b"x", u32::MAX, 1), binary(b"solid", 3, 2)] {
            assert!(matches!(read(&content), Err(IoError::Promise { .. })));
        }
        for content in [&b""[..], b"abc", &[0; 83]] {
            assert!(matches!(read(content), Err(IoError::Bytes { .. })));
        }
    }

    #[test]
    fn what_the_count_leaves_out_and_what_is_no_position_is_told_by_byte() {
        let mut far = binary(b"x", 2, 2);
        far[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
        for (content, at) in [
            (binary(b"x", 1, 2), 80),
            (binary(b"x", 0, 1), 80),
            (far, 146),
        ] {
            match read(&content) {
                Err(IoError::Bytes { offset, .. }) => assert_eq!(offset, at),
                other => panic!("{other:?}"),
            }
        }
    }

    const FACET: &str = "facet normal nan nan nan\nouter loop\nvertex 0 0 0\nvertex 1 0 -0.0\nvertex 0 1 0\nendloop\nendfacet\n";

    #[test]
    fn ascii_solids_are_merged_and_vertices_welded() {
        let text = format!(
            "\u{feff}solid\n{FACET}endsolid\nSOLID b\nendsolid b\nsolid c\n{FACET}endsolid"
        );
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
            ("endfacet\n", "", 9),
            ("endsolid x\n", "", 9),
            ("vertex 1 0 -0.0", "vertex 1 0 nan", 5),
            ("vertex 1 0 -0.0", "vertex 1 0 1e30", 5),
        ] {
            let text = format!("solid x\n{FACET}endsolid x\n").replacen(from, to, 1);
            match read(text.as_bytes()) {
                Err(IoError::Line { line, .. }) => assert_eq!(line, at, "{to}"),
                other => panic!("{to}: {other:?}"),
            }
        }
    }
}
