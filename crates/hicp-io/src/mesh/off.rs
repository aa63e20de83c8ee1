//! Object File Format (Geomview): a count of vertices and faces, then a line for each.

use hicp_core::Point3;

use super::{RawMesh, Reading, lines};
use crate::error::{END_OF_FILE, IoError, Place};
use crate::source::text_bytes;

/// Parses an OFF file. What follows three coordinates, or the corners of a face, is a normal or a colour and skipped.
pub(super) fn parse(reading: &Reading<'_>, content: Vec<u8>) -> Result<RawMesh, IoError> {
    let path = reading.path;
    let text = text_bytes(path, &content)?;
    let mut lines = Lines::new(text);
    let (counts, line) = read_counts(reading, &mut lines)?;
    let [vertices, faces] = counts.map(|count| usize::try_from(count).unwrap_or(usize::MAX));
    reading.check_vertices(lines.place(), vertices)?;
    reading.check_triangles(lines.place(), faces)?;

    let mut mesh = RawMesh::new(lines.place());
    mesh.found = line;
    mesh.vertices.reserve_exact(vertices);
    for number in 0..vertices {
        let expected = || format!("three coordinates of vertex {number} of {vertices}");
        let line = lines
            .next()
            .ok_or_else(|| lines.ended(reading, expected()))?;
        let mut numbers = line.split_whitespace().map_while(|word| word.parse().ok());
        let position = [numbers.next(), numbers.next(), numbers.next()];
        let [Some(x), Some(y), Some(z)] = position else {
            return Err(lines.error(reading, &line, expected()));
        };
        reading.check_position(lines.place(), &[x, y, z])?;
        mesh.vertices.push(Point3::new(x, y, z));
    }
    let mut corners = Vec::new();
    for face in 0..faces {
        let expected =
            || format!("the number of corners of face {face} of {faces} and as many vertices");
        let line = lines
            .next()
            .ok_or_else(|| lines.ended(reading, expected()))?;
        let mut words = line.split_whitespace();
        let count: Option<usize> = words.next().and_then(|word| word.parse().ok());
        let wrong = || lines.error(reading, &line, expected());
        let count = count.ok_or_else(wrong)?;
        corners.clear();
        for word in words.take(count) {
            let index: i64 = word.parse().map_err(|_| wrong())?;
            match u32::try_from(index) {
                Ok(corner) if (corner as usize) < vertices => corners.push(corner),
                _ => {
                    return Err(IoError::FaceIndex {
                        path: path.to_owned(),
                        place: lines.place(),
                        face,
                        index,
                        vertices,
                    });
                }
            }
        }
        if corners.len() != count {
            return Err(wrong());
        }
        mesh.add_face(reading, lines.place(), &corners)?;
        (mesh.end, mesh.found) = (lines.place(), line);
    }
    Ok(mesh)
}

/// Reads the keyword, the counts of vertices and faces and the line that tells them, and refuses what the rest of the file
/// cannot hold.
fn read_counts(
    reading: &Reading<'_>,
    lines: &mut Lines<'_>,
) -> Result<([u64; 2], String), IoError> {
    let keyword = "`OFF`, with `ST`, `C` and `N` in this order before it or not";
    let mut line = lines.next().ok_or_else(|| lines.ended(reading, keyword))?;
    // Texture coordinates, colours and normals of the vertices, which stand behind their positions.
    let mut rest = line.as_str();
    for letters in ["ST", "C", "N"] {
        rest = rest.strip_prefix(letters).unwrap_or(rest);
    }
    let Some(rest) = rest.strip_prefix("OFF").map(str::trim) else {
        return Err(lines.error(reading, &line, keyword));
    };
    let expected = "the numbers of vertices, faces and edges";
    line = match rest {
        "" => lines.next().ok_or_else(|| lines.ended(reading, expected))?,
        // Some files have the counts behind the keyword, even without a space.
        rest => rest.to_owned(),
    };
    let numbers: Option<Vec<u64>> = line
        .split_whitespace()
        .map(|word| word.parse().ok())
        .collect();
    let Some(&([vertices, faces] | [vertices, faces, _])) = numbers.as_deref() else {
        return Err(lines.error(reading, &line, expected));
    };
    let available = lines.left() as u64;
    // A vertex takes three digits with a separator each, a face at least one.
    for (what, count, bytes) in [("vertices", vertices, 6_u64), ("faces", faces, 2)] {
        let needed = bytes.saturating_mul(count);
        if needed > available {
            return Err(IoError::Promise {
                path: reading.path.to_owned(),
                place: lines.place(),
                what: what.to_owned(),
                count,
                needed,
                available,
            });
        }
    }
    Ok(([vertices, faces], line))
}

/// The lines that say something, without comments.
struct Lines<'a> {
    rest: lines::Lines<'a>,
    number: usize,
}

impl<'a> Lines<'a> {
    fn new(content: &'a [u8]) -> Self {
        Self {
            rest: lines::Lines::new(content),
            number: 0,
        }
    }

    fn next(&mut self) -> Option<String> {
        for line in self.rest.by_ref() {
            self.number += 1;
            let line = String::from_utf8_lossy(line);
            let line = line.split('#').next().unwrap_or_default().trim();
            if !line.is_empty() {
                return Some(line.to_owned());
            }
        }
        None
    }

    /// Bytes of the lines that are left, with one for the end of each.
    fn left(&self) -> usize {
        self.rest.clone().map(|line| line.len() + 1).sum()
    }

    fn place(&self) -> Place {
        Place::Line(self.number.max(1))
    }

    fn ended(&self, reading: &Reading<'_>, expected: impl Into<String>) -> IoError {
        IoError::at(reading.path, self.place(), END_OF_FILE, expected)
    }

    fn error(&self, reading: &Reading<'_>, found: &str, expected: impl Into<String>) -> IoError {
        IoError::at(reading.path, self.place(), found, expected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tests::reading;

    fn read(text: &str) -> Result<RawMesh, IoError> {
        parse(&reading("a.off"), text.as_bytes().to_vec())
    }

    const BODY: &str =
        "0 0 0\n1 0 0 # right\n1 1 0\n\n0 1 0 255 0 0\n4 0 1 2 3 0.5 0.5 0.5\n2 0 1\n3 0 1 2";

    #[test]
    fn headers_as_people_write_them() {
        for head in [
            "OFF\n4 3 0\n",
            "OFF 4 3 0\n",
            "OFF4 3 0\n",
            "\u{feff}COFF\r\n# made\r\n\r\n4 3\r\n",
            "STOFF\n4 3 0\n",
            "STCNOFF 4 3 0\n",
        ] {
            let mesh = read(&format!("{head}{BODY}")).unwrap();
            assert_eq!(
                mesh.triangles,
                [[0, 1, 2], [0, 2, 3], [0, 1, 2]],
                "{head:?}"
            );
            assert_eq!(mesh.vertices[3], Point3::new(0.0, 1.0, 0.0));
        }
        assert_eq!(
            read(&format!("OFF\n4 3 0\n{BODY}").replace('\n', "\r"))
                .unwrap()
                .triangles
                .len(),
            3
        );
    }

    #[test]
    fn lines_may_end_each_in_its_own_way() {
        let text = format!("OFF\r4 3 0\n{BODY}")
            .replace(" # right", "\r")
            .replace("0.5\n2", "0.5\r2");
        let mesh = read(&text).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        assert_eq!(mesh.vertices.len(), 4);
    }

    #[test]
    fn a_file_without_faces_tells_what_says_so() {
        for (text, at, what) in [
            ("OFF\n1 0 0\n0 0 0\n", 2, "\"1 0 0\""),
            ("OFF 1 0 0 # none\n0 0 0\n", 1, "\"1 0 0\""),
            ("OFF\n1 1 0\n0 0 0\n2 0 0\nmore", 4, "\"2 0 0\""),
        ] {
            match read(text).unwrap().finish(&reading("a.off")) {
                Err(IoError::Line {
                    line,
                    found,
                    expected,
                    ..
                }) => {
                    assert_eq!((line, found.as_str()), (at, what));
                    assert_eq!(expected, "a face of three corners or more");
                }
                other => panic!("{text:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn errors_name_the_line() {
        for (text, at) in [
            ("", 1),
            ("OF\n4 1 0\n", 1),
            ("CSTOFF\n4 1 0\n", 1),
            ("4OFF\n4 1 0\n", 1),
            ("OFF", 1),
            ("OFF\n4 x 0\n", 2),
            ("OFF\n4\n", 2),
            ("OFF BINARY\n4 1 0\n", 1),
            ("OFF\n1 1 0\n0 0 zero\n3 0 0 0", 3),
            ("OFF\n1 1 0\n0 0 nan\n3 0 0 0", 3),
            ("OFF\n1 1 0\n0 0 0\n3 0 0", 4),
            ("OFF\n1 1 0\n0 0 0\nx 0 0", 4),
            ("OFF\n2 1 0\n0 0 0\n#  x x x x\n", 4),
        ] {
            match read(text) {
                Err(IoError::Line { line, .. }) => assert_eq!(line, at, "{text:?}"),
                other => panic!("{text:?}: {other:?}"),
            }
        }
        for index in ["1", "-1"] {
            assert!(matches!(
                read(&format!("OFF\n1 1 0\n0 0 0\n3 0 0 {index}")),
                Err(IoError::FaceIndex {
                    place: Place::Line(4),
                    ..
                })
            ));
        }
        for counts in ["353535235358 6 0", "4 18446744073709551615 0"] {
            assert!(matches!(
                read(&format!("OFF\n{counts}\n{BODY}")),
                Err(IoError::Promise {
                    place: Place::Line(2),
                    ..
                })
            ));
        }
    }
}
