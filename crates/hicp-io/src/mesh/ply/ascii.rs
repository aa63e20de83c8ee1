//! ASCII payloads of PLY files.
//!
//! Read here because the grammar of `ply-rs-bw` knows neither `.5`, `1.`, `nan` nor blank lines.

use std::path::Path;

use ply_rs_bw::ply::{ElementDef, Property, PropertyType, ScalarType};

use super::Header;
use super::header::parse_scalar;
use super::rows::Row;
use crate::error::{END_OF_FILE, IoError, Place};
use crate::mesh::{Reading, lines};

/// The lines of a payload, one element each.
pub(super) struct Lines<'a> {
    path: &'a Path,
    header: &'a Header,
    lines: lines::Lines<'a>,
    line: usize,
}

impl<'a> Lines<'a> {
    /// Makes the lines that follow a header.
    pub(super) fn new(path: &'a Path, content: &'a [u8], header: &'a Header) -> Self {
        Self {
            path,
            header,
            lines: lines::Lines::new(&content[header.bytes..]),
            line: header.lines,
        }
    }

    /// Reads the elements of a kind, and hands over each.
    pub(super) fn read<E: Row>(
        &mut self,
        reading: &Reading<'_>,
        def: &ElementDef,
        take: &mut impl FnMut(Place, E) -> Result<(), IoError>,
    ) -> Result<(), IoError> {
        for number in 0..def.count {
            let Some(text) = self.next_line() else {
                let expected = format!(
                    "{} elements `{}`, of which {number} are there",
                    def.count, def.name
                );
                return Err(IoError::line(self.path, self.line, END_OF_FILE, expected));
            };
            let mut element = E::new();
            let mut words = text.split_ascii_whitespace();
            for property in def.properties.values() {
                let kept = E::keeps(property);
                let there = if kept {
                    parse_property(&mut words, &property.data_type)
                        .map(|value| element.set_property(&property.name, value))
                        .is_some()
                } else {
                    skip_property(&mut words, &property.data_type).is_some()
                };
                if !there {
                    let expected = format!(
                        "property `{}` of element `{}` as {}",
                        self.header.name_of(&property.name),
                        def.name,
                        describe(&property.data_type, kept)
                    );
                    return Err(IoError::line(self.path, self.line, text, expected));
                }
            }
            let place = Place::Line(self.line);
            element.check(reading, place)?;
            take(place, element)?;
        }
        Ok(())
    }

    /// Returns the next line that is not blank.
    fn next_line(&mut self) -> Option<&'a str> {
        for line in self.lines.by_ref() {
            self.line += 1;
            // What is not text is no number either.
            let text = std::str::from_utf8(line).unwrap_or("not text");
            if !text.trim().is_empty() {
                return Some(text);
            }
        }
        None
    }
}

fn parse_property<'a>(
    words: &mut impl Iterator<Item = &'a str>,
    data_type: &PropertyType,
) -> Option<Property> {
    match data_type {
        PropertyType::Scalar(scalar) => parse_scalar(words.next()?, scalar),
        PropertyType::List(..) => {
            let count: usize = words.next()?.parse().ok()?;
            // The declared width matters in binary files only; indices are checked against the vertices anyway.
            let integers: Vec<i32> = words
                .take(count)
                .map_while(|word| word.parse().ok())
                .collect();
            (integers.len() == count).then_some(Property::ListInt(integers))
        }
    }
}

/// Goes past a property that nobody reads, whatever its words say: exporters write what does not fit the type, or is no number.
fn skip_property<'a>(
    words: &mut impl Iterator<Item = &'a str>,
    data_type: &PropertyType,
) -> Option<()> {
    let count: usize = match data_type {
        PropertyType::Scalar(_) => 1,
        PropertyType::List(..) => words.next()?.parse().ok()?,
    };
    (words.take(count).count() == count).then_some(())
}

fn describe(data_type: &PropertyType, kept: bool) -> &'static str {
    match data_type {
        PropertyType::Scalar(_) if !kept => "a word",
        PropertyType::Scalar(ScalarType::Float | ScalarType::Double) => "a number",
        PropertyType::Scalar(_) => "an integer in the range of its type",
        PropertyType::List(..) if !kept => "a count and that many words",
        PropertyType::List(..) => "a count and that many 32-bit integers",
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse_mesh;
    use super::*;
    use crate::mesh::tests::reading;

    const HEAD: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property double z\nelement face 1\nproperty list uchar int vertex_indices\nproperty uchar red\nend_header\n";

    #[test]
    fn numbers_as_people_write_them() {
        let text = format!("{HEAD}.5 1. +1e0\r\n\n  -.5\t0 0 99\n1 1 1E-3\n\n3 0 1 2 255");
        let mesh = parse_mesh(&reading("a.ply"), text.into_bytes()).unwrap();
        assert_eq!(mesh.vertices[0].coords.as_slice(), [0.5, 1.0, 1.0]);
        assert_eq!(mesh.vertices[2].z, 0.001);
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }

    #[test]
    fn errors_name_the_line() {
        for (body, at) in [
            ("0 0 0\n1 0\n0 1 0\n3 0 1 2 0\n", 12),
            ("0 0 0\n1 0 x\n0 1 0\n3 0 1 2 0\n", 12),
            ("0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", 14),
            ("0 0 0\n1 0 0\n0 1 0\n3 0 1 4294967295 0\n", 14),
            ("0 0 0\r\n1 0 0\r0 1 0\n\r3 0 1 2\r", 15),
            ("0 0 0\n1 0 0\n0 1 0\n9999999999 0 1 2 0\n", 14),
            ("0 0 0\n1 0 0\n0 1 0\n3 0 1 2.5 0\n", 14),
            ("0 0 0\n1 0 0\n0 1 0\n-3 0 1 2 0\n", 14),
            ("0 0 0\n1 0 0\n0 1 0 0 0 0 0 0\n\n", 14),
            ("0 0 0\n1 0 nan\n0 1 0\n3 0 1 2 0\n", 12),
            ("0 0 0\n1 0 0\n0 1 -1e9\n3 0 1 2 0\n", 13),
            ("0 0 0\n1 0 0\n0 1 0\n3\n0 1 2 0\n", 14),
        ] {
            match parse_mesh(&reading("a.ply"), format!("{HEAD}{body}").into_bytes()) {
                Err(IoError::Line { line, .. }) => assert_eq!(line, at, "{body:?}"),
                other => panic!("{body:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn every_line_may_end_in_its_own_way() {
        for body in [
            "0 0 0\r1 0 0\r0 1 0\r3 0 1 2 0\r",
            "0 0 0\r\n1 0 0\r0 1 0\n\r\n3 0 1 2 0",
        ] {
            for head in [HEAD.to_owned(), HEAD.replace('\n', "\r")] {
                let text = format!("{head}{body}");
                let mesh = parse_mesh(&reading("a.ply"), text.into_bytes()).unwrap();
                assert_eq!(mesh.vertices[1].coords.as_slice(), [1.0, 0.0, 0.0]);
                assert_eq!(mesh.triangles, [[0, 1, 2]]);
            }
        }
    }

    #[test]
    fn words_that_nobody_reads_are_counted_only() {
        let head = "ply\nformat ascii 1.0\nelement odd 1\nproperty list uchar int ids\nelement vertex 3\n\
            property float nx\nproperty uchar red\nproperty float x\nproperty float y\nproperty float z\n\
            element face 1\nproperty list uchar uint rgba\nproperty list uchar int vertex_indices\n\
            property uchar a%1\nend_header\n";
        let body = "2 4294967295 x\n-nan(ind) 256 0 0 0\nnan 0.5 1 0 0\n1,5 red 0 1 0\n1 4294967295 3 0 1 2 -1\n";
        let mesh = parse_mesh(&reading("a.ply"), format!("{head}{body}").into_bytes()).unwrap();
        assert_eq!(mesh.vertices[1].coords.as_slice(), [1.0, 0.0, 0.0]);
        assert_eq!(mesh.triangles, [[0, 1, 2]]);

        for (given, short, at, property) in [
            ("2 4294967295 x", "2 4294967295", 16, "ids"),
            ("2 4294967295 x", "x 4294967295", 16, "ids"),
            ("2 4294967295 x", "-2 4294967295", 16, "ids"),
            ("-nan(ind) 256 0 0 0", "-nan(ind) 256 0 0", 17, "z"),
            (" 0 1 2 -1", " 0 1 2", 20, "a%1"),
        ] {
            let text = format!("{head}{}", body.replace(given, short));
            match parse_mesh(&reading("a.ply"), text.into_bytes()) {
                Err(IoError::Line { line, expected, .. }) => {
                    assert_eq!(line, at, "{short}");
                    let named = format!("property `{property}` of ");
                    assert!(expected.starts_with(&named), "{expected}");
                }
                other => panic!("{short}: {other:?}"),
            }
        }
    }
}
