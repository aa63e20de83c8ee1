//! Wavefront OBJ, read with `tobj`.
//!
//! The reader gets the two records that make a mesh, `v` and `f`, in a plain form: it neither joins continued lines nor
//! forgives broken colours, and it says what is wrong but not where. Handing it one record per line tells the line.

use std::io::{self, BufRead, Read};

use hicp_core::Point3;

use super::lines::Lines;
use super::{RawMesh, Reading};
use crate::error::{IoError, Place};
use crate::source::text_bytes;

/// Parses an OBJ file. Vertices that no face uses are dropped.
pub(super) fn parse(reading: &Reading<'_>, content: Vec<u8>) -> Result<RawMesh, IoError> {
    let records = Records::of(reading, text_bytes(reading.path, &content)?)?;
    drop(content);
    records.check_positions(reading)?;
    let options = tobj::LoadOptions {
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let mut reader = CountingReader {
        rest: records.text.as_bytes(),
        lines: 0,
    };
    // Materials are never asked for: no `mtllib` gets through.
    let models = tobj::load_obj_buf(&mut reader, &options, |_| Err(tobj::LoadError::ReadError))
        .map_err(|error| {
            let at_fault = match error {
                tobj::LoadError::FaceVertexOutOfBounds => records.first_missing_vertex(),
                _ => reader.lines.saturating_sub(1),
            };
            records.error(reading, at_fault, error)
        })?
        .0;

    let end = Place::Line(records.end.max(1));
    let mut mesh = RawMesh::new(end);
    // As many faces come back, in their order.
    let mut places = records.into_face_lines().into_iter().map(Place::Line);
    let mut place = || places.next().unwrap_or(end);
    for tobj::Model { mesh: part, .. } in models {
        // One model comes back, as no record that starts another gets through.
        mesh.vertices.extend(
            part.positions
                .chunks_exact(3)
                .map(|p| Point3::new(p[0], p[1], p[2])),
        );
        if part.face_arities.is_empty() {
            for corners in part.indices.chunks_exact(3) {
                mesh.add_face(reading, place(), corners)?;
            }
        } else {
            let mut rest = part.indices.as_slice();
            for arity in part.face_arities {
                let (corners, others) = rest.split_at((arity as usize).min(rest.len()));
                mesh.add_face(reading, place(), corners)?;
                rest = others;
            }
        }
    }
    Ok(mesh)
}

/// The `v` and `f` records of a file, one per line, and the lines they come from.
#[derive(Debug, Default)]
struct Records {
    text: String,
    lines: Vec<u32>,
    vertices: usize,
    triangles: usize,
    /// The last line.
    end: usize,
}

impl Records {
    fn of(reading: &Reading<'_>, content: &[u8]) -> Result<Self, IoError> {
        let mut records = Self::default();
        let mut pending = String::new();
        for (number, line) in (1_u32..).zip(Lines::new(content)) {
            records.end = number as usize;
            let line = String::from_utf8_lossy(line);
            let line = line.split('#').next().unwrap_or_default().trim();
            if let Some(start) = line.strip_suffix('\\') {
                pending.push_str(start);
                pending.push(' ');
            } else if pending.is_empty() {
                records.add(reading, line, number)?;
            } else {
                pending.push_str(line);
                records.add(reading, &std::mem::take(&mut pending), number)?;
            }
        }
        // The last line may promise another that does not come.
        let end = u32::try_from(records.end).unwrap_or(u32::MAX);
        records.add(reading, &pending, end)?;
        Ok(records)
    }

    fn add(&mut self, reading: &Reading<'_>, line: &str, number: u32) -> Result<(), IoError> {
        let place = Place::Line(number as usize);
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                self.vertices += 1;
                reading.check_vertices(place, self.vertices)?;
                self.text.push('v');
                // A colour, or a fourth number: a weight, which is for rational curves and not for faces, or a confidence.
                for word in words.take(3) {
                    self.text.push(' ');
                    self.text.push_str(word);
                }
            }
            // Fewer corners make no face: they are not kept, for any number of such records would pass the limit.
            Some("f") if words.clone().count() >= 3 => {
                self.text.push('f');
                self.triangles += words.clone().count() - 2;
                reading.check_triangles(place, self.triangles)?;
                for word in words {
                    let position = word.split('/').next().filter(|index| !index.is_empty());
                    self.text.push(' ');
                    self.text.push_str(position.unwrap_or(word));
                }
            }
            _ => return Ok(()),
        }
        self.text.push('\n');
        self.lines.push(number);
        Ok(())
    }

    /// Refuses vertices whose coordinates no mesh can have; what is no number at all is told by the reader.
    fn check_positions(&self, reading: &Reading<'_>) -> Result<(), IoError> {
        for (record, line) in self.text.lines().zip(&self.lines) {
            let mut words = record.split(' ');
            if words.next() != Some("v") {
                continue;
            }
            let mut numbers = words.map_while(|word| word.parse::<f64>().ok());
            let position = [numbers.next(), numbers.next(), numbers.next()];
            if let [Some(x), Some(y), Some(z)] = position {
                reading.check_position(Place::Line(*line as usize), &[x, y, z])?;
            }
        }
        Ok(())
    }

    /// Returns the record of the first face that names a vertex that is not there.
    fn first_missing_vertex(&self) -> usize {
        let is_vertex = |record: &str| record.starts_with('v');
        let vertices = self.text.lines().filter(|record| is_vertex(record)).count();
        let mut seen = 0;
        for (record, line) in self.text.lines().enumerate() {
            if is_vertex(line) {
                seen += 1;
                continue;
            }
            let valid = |word: &str| match word.parse::<i64>() {
                Ok(index) if index < 0 => index.unsigned_abs() <= seen,
                Ok(index) => (1..=vertices).contains(&usize::try_from(index).unwrap_or(0)),
                Err(_) => false,
            };
            if !line.split_whitespace().skip(1).all(valid) {
                return record;
            }
        }
        0
    }

    /// The line of every face.
    fn into_face_lines(self) -> Vec<usize> {
        let records = self.text.lines().zip(self.lines);
        let faces = records.filter(|(record, _)| record.starts_with('f'));
        faces.map(|(_, line)| line as usize).collect()
    }

    fn error(&self, reading: &Reading<'_>, record: usize, error: tobj::LoadError) -> IoError {
        use tobj::LoadError as E;
        let vertices = self.vertices;
        let expected = match error {
            E::PositionParseError => "`v` and three numbers".to_owned(),
            E::FaceParseError => "`f` and vertex indices".to_owned(),
            E::FaceVertexOutOfBounds => format!(
                "vertex indices from 1 to {vertices}, or negative ones that count back no further than the first vertex"
            ),
            other => format!("a readable record ({other})"),
        };
        let line = self.lines.get(record).copied().unwrap_or(1);
        let found = self.text.lines().nth(record).unwrap_or_default();
        IoError::line(reading.path, line as usize, found, expected)
    }
}

/// Counts the lines taken from it.
struct CountingReader<'a> {
    rest: &'a [u8],
    lines: usize,
}

impl Read for CountingReader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = (&mut self.rest).read(buffer)?;
        self.lines += buffer[..count].iter().filter(|b| **b == b'\n').count();
        Ok(count)
    }
}

impl BufRead for CountingReader<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        Ok(self.rest)
    }

    fn consume(&mut self, amount: usize) {
        let (taken, rest) = self.rest.split_at(amount);
        self.lines += taken.iter().filter(|b| **b == b'\n').count();
        self.rest = rest;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tests::reading;

    fn read(text: &str) -> Result<RawMesh, IoError> {
        parse(&reading("a.obj"), text.as_bytes().to_vec())
    }

    #[test]
    fn continuations_comments_colours_groups_and_relative_indices() {
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
    fn old_line_endings_and_latin_comments() {
        let text = b"# M\xfcller\rv 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r";
        let mesh = parse(&reading("a.obj"), text.to_vec()).unwrap();
        assert_eq!(mesh.triangles.len(), 1);
    }

    #[test]
    fn errors_name_the_line_and_what_stands_there() {
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
                Err(IoError::Line { line, found, .. }) => {
                    assert_eq!((line, found), (at, format!("{record:?}")));
                }
                other => panic!("{record}: {other:?}"),
            }
        }
    }

    #[test]
    fn positions_that_no_mesh_can_have_are_told_by_line() {
        for record in ["v 1 2 1e30", "v nan 0 0", "v 0 -inf 0"] {
            let text = format!("v 0 0 0\n{record}\nv 0 1 0\nf 1 2 3\n");
            assert!(
                matches!(read(&text), Err(IoError::Line { line: 2, .. })),
                "{record}"
            );
        }
    }

    #[test]
    fn a_line_that_is_continued_at_the_end_of_the_file_is_read() {
        let mesh = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1 \\").unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 0]]);
        assert!(read("v 0 0 0\nf 1 \\").unwrap().triangles.is_empty());
        assert!(read("\\").unwrap().triangles.is_empty());
        match read("v 0 0 0\nv 1 \\\n0 x \\") {
            Err(IoError::Line { line, found, .. }) => {
                assert_eq!((line, found.as_str()), (3, "\"v 1 0 x\""));
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn lines_may_end_each_in_its_own_way() {
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
    fn faces_of_fewer_than_three_corners_are_not_kept() {
        let text = format!("v 0 0 0\n{}f 1 1 1\nf\n", "f 9 9\nf\n".repeat(100));
        let records = Records::of(&reading("a.obj"), text.as_bytes()).unwrap();
        assert_eq!(records.text, "v 0 0 0\nf 1 1 1\n");
        assert_eq!((records.triangles, records.end), (1, 203));
        assert_eq!(records.into_face_lines(), [202]);
    }

    #[test]
    fn every_face_that_is_kept_counts_against_the_limit() {
        let limits = crate::ReadLimits {
            max_triangles: 3,
            ..crate::ReadLimits::DEFAULT
        };
        let reading = Reading {
            limits: &limits,
            ..reading("a.obj")
        };
        let text = "v 0 0 0\nf 1 1 1\nf 1 1 1 1\n";
        assert!(parse(&reading, text.into()).is_ok());
        assert!(matches!(
            parse(&reading, format!("{text}f 1 1\nf 1 1 1\n").into()),
            Err(IoError::Limit {
                place: Some(Place::Line(5)),
                count: 4,
                ..
            })
        ));
    }
}
