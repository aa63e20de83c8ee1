//! Object File Format (Geomview) files: counts of vertices and faces, then one line for each.

use super::lines::{Lines, numbers};
use super::raw::{FACE, RawMesh, Reading, position};
use crate::error::{IoError, quote};
use crate::limits::Limit;
use crate::source::lossy_text;

/// Parses an OFF file.
///
/// Skips the normals and colors that follow three coordinates or the corners of a face.
pub(super) fn parse(reading: Reading<'_>, content: Vec<u8>) -> Result<RawMesh<'_>, IoError> {
    let text = lossy_text(reading.path, &content)?;
    let mut lines = Lines::new(&text);
    let (line, vertices, faces) = parse_counts(&reading, &mut lines)?;
    reading.check(Limit::VERTICES, lines.place(), vertices)?;
    reading.check(Limit::TRIANGLES, lines.place(), faces)?;

    let mut mesh = RawMesh::new(reading, reading.refuse(lines.place(), quote(line), FACE));
    mesh.vertices.reserve_exact(vertices);
    for vertex in 0..vertices {
        let line = lines.record();
        let position = position(line.split_whitespace()).ok_or_else(|| {
            let expected = format!("three coordinates of vertex {vertex} of {vertices}");
            lines.refuse(&reading, line, expected)
        })?;
        mesh.add_vertex(lines.place(), position)?;
    }
    let mut line = "";
    for face in 0..faces {
        line = lines.record();
        let mut numbers = numbers::<i64>(line);
        let count = numbers.next().and_then(|count| usize::try_from(count).ok());
        let corners = numbers.take(count.unwrap_or(0)).map(|index| index as f64);
        let corners: Vec<f64> = corners.collect();
        if count != Some(corners.len()) {
            let expected =
                format!("the number of corners of face {face} of {faces} and as many vertices");
            return Err(lines.refuse(&reading, line, expected));
        }
        mesh.add_corners(lines.place(), face, &corners)?;
    }
    if faces > 0 {
        mesh.empty = reading.refuse(lines.place(), quote(line), FACE);
    }
    Ok(mesh)
}

/// Parses the keyword and the line with the numbers of vertices and faces.
///
/// Refuses numbers of elements that the rest of the file cannot hold.
fn parse_counts<'a>(
    reading: &Reading<'_>,
    lines: &mut Lines<'a>,
) -> Result<(&'a str, usize, usize), IoError> {
    let first = lines.record();
    // The prefixes announce texture coordinates, colors and normals after the position of a vertex.
    let mut rest = first;
    for letters in ["ST", "C", "N"] {
        rest = rest.strip_prefix(letters).unwrap_or(rest);
    }
    let Some(rest) = rest.strip_prefix("OFF") else {
        let expected = "`OFF`, optionally after `ST`, `C` and `N` in this order";
        return Err(lines.refuse(reading, first, expected.to_owned()));
    };
    let line = match rest.trim() {
        "" => lines.record(),
        // Some files have the counts after the keyword, even without a space.
        counts => counts,
    };
    let words = line.split_whitespace();
    let counts: Option<Vec<usize>> = words.map(|word| word.parse().ok()).collect();
    let Some(&([vertices, faces] | [vertices, faces, _])) = counts.as_deref() else {
        let expected = "the numbers of vertices, faces and edges";
        return Err(lines.refuse(reading, line, expected.to_owned()));
    };
    // The last line may have no ending. A vertex takes at least three digits with a separator each,
    // a face one.
    let left = lines.left() + 1;
    for (what, count, bytes) in [("vertices", vertices as u64, 6), ("faces", faces as u64, 2)] {
        let needed = count.saturating_mul(bytes);
        IoError::check_promise(reading.path, lines.place(), (count, what), needed, left)?;
    }
    Ok((line, vertices, faces))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Place;
    use crate::mesh::tests::reading;
    use hicp_core::Point3;

    fn read(text: &str) -> Result<RawMesh<'static>, IoError> {
        parse(reading("a.off"), text.as_bytes().to_vec())
    }

    const BODY: &str =
        "0 0 0\n1 0 0 # right\n1 1 0\n\n0 1 0 255 0 0\n4 0 1 2 3 0.5 0.5 0.5\n2 0 1\n3 0 1 2";

    #[test]
    fn headers_of_all_common_forms_are_read() {
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
    fn line_endings_may_be_mixed() {
        let text = format!("OFF\r4 3 0\n{BODY}")
            .replace(" # right", "\r")
            .replace("0.5\n2", "0.5\r2");
        let mesh = read(&text).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        assert_eq!(mesh.vertices.len(), 4);
    }

    #[test]
    fn the_error_for_a_file_without_faces_quotes_the_responsible_line() {
        for (text, at, what) in [
            ("OFF\n1 0 0\n0 0 0\n", 2, "\"1 0 0\""),
            ("OFF 1 0 0 # none\n0 0 0\n", 1, "\"1 0 0\""),
            ("OFF\n1 1 0\n0 0 0\n2 0 0\nmore", 4, "\"2 0 0\""),
        ] {
            match read(text).unwrap().finish() {
                Err(IoError {
                    found,
                    expected,
                    place: Some(Place::Line(line)),
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
                Err(IoError {
                    place: Some(Place::Line(line)),
                    ..
                }) => assert_eq!(line, at, "{text:?}"),
                other => panic!("{text:?}: {other:?}"),
            }
        }
        for index in ["1", "-1"] {
            assert!(matches!(
                read(&format!("OFF\n1 1 0\n0 0 0\n3 0 0 {index}")),
                Err(IoError { place: Some(Place::Line(4)), found, .. })
                if found == format!("vertex {index} in face 0")
            ));
        }
        for counts in ["353535235358 6 0", "4 18446744073709551615 0"] {
            assert!(matches!(
                read(&format!("OFF\n{counts}\n{BODY}")),
                Err(IoError { place: Some(Place::Line(2)), found, .. }) if found.contains("promises")
            ));
        }
    }
}
