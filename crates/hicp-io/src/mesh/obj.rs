//! Wavefront OBJ files, parsed by `tobj`.
//!
//! Continued lines are joined first. Only positions and faces are passed to `tobj`, each on its
//! original line, because `tobj` has four limitations:
//!
//! - It refuses files with colors on only some vertices.
//! - It refuses files that refer to missing normals or texture coordinates.
//! - It divides positions by a fourth number.
//! - It splits vertices that groups share.

use hicp_core::Point3;
use tobj::{LoadError, LoadOptions};

use super::lines::{Lines, without_comment};
use super::materials::Materials;
use super::raw::{FACE, RawMesh, Reading, position};
use crate::error::{END_OF_FILE, IoError, Place, quote};
use crate::limits::Limit;
use crate::source::lossy_text;

/// Parses an OBJ file. Vertices that no face uses are dropped.
pub(super) fn parse(reading: Reading<'_>, content: Vec<u8>) -> Result<RawMesh<'_>, IoError> {
    let records = Records::of(&reading, &lossy_text(reading.path, &content)?)?;
    drop(content);
    let no_materials = |_: &_| Err(LoadError::ReadError);
    let loaded = tobj::load_obj_buf(
        &mut records.text.as_bytes(),
        &LoadOptions::default(),
        no_materials,
    );
    let (models, _) = loaded.map_err(|error| {
        let unknown = || IoError::unusable(reading.path, "OBJ mesh", error);
        records.fault(&reading).unwrap_or_else(unknown)
    })?;

    let end = Place::Line(records.text.lines().count().max(1));
    let mut mesh = RawMesh::new(reading, reading.refuse(end.clone(), END_OF_FILE, FACE));
    let materials = &records.materials;
    let mut coverage = materials.load(&reading, records.vertices, &mut mesh.colors);
    // Without groups, there is one model, and it has the faces in the order of the file.
    for tobj::Model { mesh: part, .. } in models {
        let positions = part.positions.chunks_exact(3);
        mesh.vertices = positions.map(Point3::from_slice).collect();
        let mut rest = part.indices.as_slice();
        for (index, line) in records.faces.iter().enumerate() {
            // `tobj` lists the numbers of corners only if there are faces other than triangles.
            let arity = part.face_arities.get(index).copied().unwrap_or(3);
            let (corners, others) = rest.split_at(arity as usize);
            mesh.add_face(Place::Line(*line), corners)?;
            coverage.cover(corners, &mut mesh);
            rest = others;
        }
    }
    coverage.finish(&mut mesh.colors);
    let fits = |p: &Point3<f64>| {
        reading
            .check_position(end.clone(), p.coords.as_slice())
            .is_ok()
    };
    // `tobj` drops unused vertices, so their records are checked separately.
    if mesh.vertices.len() == records.vertices && mesh.vertices.iter().all(fits) {
        return Ok(mesh);
    }
    records.fault(&reading).map_or(Ok(mesh), Err)
}

/// The `v` and `f` records of a file, each on its last line. All other lines are blank.
#[derive(Debug, Default)]
struct Records {
    text: String,
    vertices: usize,
    triangles: usize,
    /// The line of each face.
    faces: Vec<usize>,
    materials: Materials,
}

impl Records {
    fn of(reading: &Reading<'_>, text: &str) -> Result<Self, IoError> {
        let mut records = Self::default();
        let mut joined = String::new();
        let mut lines = (1..).zip(Lines::new(text)).peekable();
        while let Some((number, line)) = lines.next() {
            let line = without_comment(line);
            joined.push_str(line.strip_suffix('\\').unwrap_or(line));
            // A backslash on the last line of the file has nothing to continue.
            if line.ends_with('\\') && lines.peek().is_some() {
                joined.push(' ');
            } else {
                records.add(reading, &joined, number)?;
                joined.clear();
            }
            records.text.push('\n');
        }
        Ok(records)
    }

    fn add(&mut self, reading: &Reading<'_>, line: &str, number: usize) -> Result<(), IoError> {
        let place = Place::Line(number);
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                self.vertices += 1;
                reading.check(Limit::VERTICES, place, self.vertices)?;
                self.text.push('v');
                // More numbers may follow: colors, the weight of a curve, or a confidence.
                for word in words.clone().take(3) {
                    self.text.push(' ');
                    self.text.push_str(word);
                }
                if reading.with_color {
                    self.materials.add_vertex(words.skip(3));
                }
            }
            // Records with fewer corners are not faces. They are dropped because the limit does not
            // count them.
            Some("f") if words.clone().nth(2).is_some() => {
                self.triangles += words.clone().count() - 2;
                reading.check(Limit::TRIANGLES, place, self.triangles)?;
                self.faces.push(number);
                self.text.push('f');
                if reading.with_color {
                    self.materials.add_face(words.clone(), self.vertices);
                }
                for word in words {
                    let position = word.split('/').next().filter(|index| !index.is_empty());
                    self.text.push(' ');
                    self.text.push_str(position.unwrap_or(word));
                }
            }
            Some(other) if reading.with_color => self.materials.add(other, line),
            _ => {}
        }
        Ok(())
    }

    /// Returns the error for the first invalid record with its line, which `tobj` does not report.
    fn fault(&self, reading: &Reading<'_>) -> Option<IoError> {
        let mut seen = 0;
        let is_vertex = |word: &str, seen: usize| match word.parse::<isize>() {
            Ok(index) if index < 0 => index.unsigned_abs() <= seen,
            Ok(index) => (1..=self.vertices).contains(&index.unsigned_abs()),
            Err(_) => false,
        };
        (1..).zip(self.text.lines()).find_map(|(line, record)| {
            let place = Place::Line(line);
            let mut words = record.split_whitespace();
            let expected = match words.next() {
                Some("v") => {
                    seen += 1;
                    if let Some(position) = position(words) {
                        return reading.check_position(place, &position).err();
                    }
                    "`v` and three numbers".to_owned()
                }
                Some("f") if !words.all(|word| is_vertex(word, seen)) => format!(
                    "`f` and vertex indices from 1 to {}, or negative ones that count back to the first vertex at most",
                    self.vertices
                ),
                _ => return None,
            };
            Some(reading.refuse(place, quote(record), expected))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::IoErrorKind;
    use crate::mesh::tests::reading;

    fn read(text: &str) -> Result<RawMesh<'static>, IoError> {
        parse(reading("a.obj"), text.as_bytes().to_vec())
    }

    #[test]
    fn continuations_comments_colors_groups_and_relative_indices_are_read() {
        let mesh = read(
            "# exported \\\r\nmtllib no such.mtl\r\nv 0 0 0 nan nan nan\r\nv 1 0 0 # right\r\nv 1 \\\r\n 1 0\r\no b\r\n\
             usemtl\r\nv 0 1 0 0.5\r\nl 1 2\r\np 1\r\ng c\r\nf -4/1/9 -3//2 \\\r\n -2 -1\r\nf 1/ 2/ 3/",
        )
        .unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        assert_eq!(mesh.vertices[2], Point3::new(1.0, 1.0, 0.0));
        assert_eq!(mesh.vertices[3], Point3::new(0.0, 1.0, 0.0));
    }

    #[test]
    fn old_line_endings_and_latin_comments_are_read() {
        let text = b"# M\xfcller\rv 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r";
        let mesh = parse(reading("a.obj"), text.to_vec()).unwrap();
        assert_eq!(mesh.triangles.len(), 1);
    }

    #[test]
    fn errors_name_the_line_and_its_content() {
        let head = "# c\nv 0 0 0\nv 1 0 0\nv 0 1 0\n\n";
        for (record, at) in [
            ("v 1 2", 6),
            ("v 1 2 x", 6),
            ("f 1 2 x", 6),
            ("f 1 2 4", 6),
            ("f 1 2 0", 6),
            ("f 1 2 -4", 6),
            ("f 1 2 99999999999999999999", 6),
            ("f 1 2 -9223372036854775808", 6),
        ] {
            match read(&format!("{head}{record}\nf 1 2 3\n")) {
                Err(IoError {
                    found,
                    place: Some(Place::Line(line)),
                    ..
                }) => {
                    assert_eq!((line, found), (at, format!("{record:?}")));
                }
                other => panic!("{record}: {other:?}"),
            }
        }
    }

    #[test]
    fn a_continued_line_at_the_end_of_the_file_is_read() {
        let mesh = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1 \\").unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 0]]);
        assert!(read("v 0 0 0\nf 1 \\").unwrap().triangles.is_empty());
        assert!(read("\\").unwrap().triangles.is_empty());
        match read("v 0 0 0\nv 1 \\\n0 x \\") {
            Err(IoError {
                found,
                place: Some(Place::Line(line)),
                ..
            }) => {
                assert_eq!((line, found.as_str()), (3, "\"v 1 0 x\""));
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn line_endings_may_be_mixed() {
        for text in [
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\ng a\rf 1 3 4",
            "v 0 0 0\rv 1 0 0\rv 1 1 0\rv 0 1 0\rf 1 2 3 # a\rf 1 3 4\n",
            "v 0 0 0\r\nv 1 0 0\nv 1 1 0\rv 0 1 0\r\nf 1 2 3 \\\r 4",
        ] {
            let mesh = read(text).unwrap();
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{text:?}");
        }
    }

    #[test]
    fn faces_of_fewer_than_three_corners_are_dropped() {
        let text = format!("v 0 0 0\n{}f 1 1 1\nf\n", "f 9 9\nf\n".repeat(100));
        let records = Records::of(&reading("a.obj"), &text).unwrap();
        let kept: Vec<&str> = records.text.split_whitespace().collect();
        assert_eq!(kept, ["v", "0", "0", "0", "f", "1", "1", "1"]);
        assert_eq!((records.triangles, records.text.lines().count()), (1, 203));
        assert_eq!(records.faces, [202]);
    }

    #[test]
    fn every_kept_face_counts_toward_the_limit() {
        let limits = crate::ReadLimits {
            max_triangles: 3,
            ..crate::ReadLimits::DEFAULT
        };
        let reading = Reading {
            limits: &limits,
            ..reading("a.obj")
        };
        let text = "v 0 0 0\nf 1 1 1\nf 1 1 1 1\n";
        assert!(parse(reading, text.into()).is_ok());
        assert!(matches!(
            parse(reading, format!("{text}f 1 1\nf 1 1 1\n").into()),
            Err(IoError { kind: IoErrorKind::Limit, place: Some(Place::Line(5)), found, .. })
            if found == "4 triangles"
        ));
    }
}
