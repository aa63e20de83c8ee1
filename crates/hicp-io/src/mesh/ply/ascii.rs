//! ASCII payloads of PLY files.
//!
//! Read here because the grammar of `ply-rs-bw` knows neither `.5`, `1.`, `nan` nor blank lines.

use std::path::Path;

use ply_rs_bw::ply::{ElementDef, Property, PropertyAccessResult, PropertyType, ScalarType};

use super::Header;
use super::header::parse_scalar;
use super::rows::Row;
use crate::error::{END_OF_FILE, IoError, Place};
use crate::mesh::Reading;

/// The lines of a payload, one element each.
pub(super) struct Lines<'a> {
    path: &'a Path,
    rest: &'a [u8],
    line_end: u8,
    line: usize,
}

impl<'a> Lines<'a> {
    /// Makes the lines that follow a header.
    pub(super) fn new(path: &'a Path, content: &'a [u8], header: &Header) -> Self {
        Self {
            path,
            rest: &content[header.bytes..],
            line_end: header.line_end,
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
                let value = parse_property(&mut words, &property.data_type);
                let result = value.map(|value| element.set_property(&property.name, value));
                if matches!(result, None | Some(PropertyAccessResult::UnsupportedType)) {
                    let expected = format!(
                        "property `{}` of element `{}` as {}",
                        property.name,
                        def.name,
                        describe(&property.data_type)
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
        while !self.rest.is_empty() {
            let end = self.rest.iter().position(|byte| *byte == self.line_end);
            let (line, rest) = match end {
                Some(end) => (&self.rest[..end], &self.rest[end + 1..]),
                None => (self.rest, &[][..]),
            };
            self.rest = rest;
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
        PropertyType::List(_, scalar) => {
            let count: usize = words.next()?.parse().ok()?;
            if matches!(scalar, ScalarType::Float | ScalarType::Double) {
                list(words, count).map(Property::ListDouble)
            } else {
                // The declared width matters in binary files only; indices are checked against the vertices anyway.
                let integers: Vec<i64> = list(words, count)?;
                let narrow = integers
                    .iter()
                    .map(|i| i32::try_from(*i))
                    .collect::<Result<_, _>>();
                narrow.ok().map(Property::ListInt)
            }
        }
    }
}

fn list<'a, T: std::str::FromStr>(
    words: &mut impl Iterator<Item = &'a str>,
    count: usize,
) -> Option<Vec<T>> {
    let values: Vec<T> = words
        .take(count)
        .map_while(|word| word.parse().ok())
        .collect();
    (values.len() == count).then_some(values)
}

fn describe(data_type: &PropertyType) -> &'static str {
    match data_type {
        PropertyType::Scalar(ScalarType::Float | ScalarType::Double) => "a number",
        PropertyType::Scalar(_) => "an integer in the range of its type",
        PropertyType::List(_, ScalarType::Float | ScalarType::Double) => {
            "a count and that many numbers"
        }
        PropertyType::List(..) => "a count and that many integers",
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
            ("0 0 0\n1 0 0\n0 1 0\n3 0 1 2 256\n", 14),
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
}
