//! The rows of a PLY file, which follow its header.

use std::str::SplitAsciiWhitespace;

use super::header::{Element, Encoding, Header, Property, Scalar};
use crate::error::{END_OF_FILE, IoError, Place, quote};
use crate::mesh::lines::Lines;
use crate::mesh::raw::Reading;

/// The rest of a file: a line per element, or bytes.
#[derive(Clone)]
pub(super) enum Rows<'a> {
    Ascii(Lines<'a>),
    Binary {
        rest: &'a [u8],
        file_bytes: usize,
        big_endian: bool,
    },
}

impl<'a> Rows<'a> {
    pub(super) fn new(content: &'a [u8], header: &Header) -> Self {
        let rest = &content[header.bytes..];
        match header.encoding {
            Encoding::Ascii => Self::Ascii(Lines::after(header.lines, rest)),
            encoding => Self::Binary {
                rest,
                file_bytes: content.len(),
                big_endian: encoding == Encoding::BigEndian,
            },
        }
    }

    /// Reads all elements of a kind. Passes the place of each to `take`, and the numbers that are kept.
    pub(super) fn read(
        &mut self,
        reading: &Reading<'_>,
        element: &Element,
        keep: impl Fn(&Property) -> bool,
        mut take: impl FnMut(Place, &[f64]) -> Result<(), IoError>,
    ) -> Result<(), IoError> {
        let properties: Vec<_> = element.properties.iter().map(|p| (p, keep(p))).collect();
        let mut numbers = Vec::new();
        for row in 0..element.count {
            numbers.clear();
            let place = match self {
                Self::Ascii(lines) => {
                    let is_blank = |line: &[u8]| line.trim_ascii().is_empty();
                    let Some(line) = lines.find(|line| !is_blank(line)) else {
                        let (count, name) = (element.count, &element.name);
                        let expected =
                            format!("{count} elements `{name}`, of which {row} are there");
                        return Err(reading.refuse(
                            Place::Line(lines.number()),
                            END_OF_FILE,
                            expected,
                        ));
                    };
                    let place = Place::Line(lines.number());
                    // What is not text is not a number either.
                    let line = std::str::from_utf8(line).unwrap_or("not text");
                    let mut words = line.split_ascii_whitespace();
                    for (property, kept) in &properties {
                        let next = |scalar, kept| next_word(&mut words, scalar, kept);
                        if property.read(*kept, &mut numbers, next).is_none() {
                            let expected = property.expected(element, *kept);
                            return Err(reading.refuse(place, quote(line), expected));
                        }
                    }
                    place
                }
                Self::Binary {
                    rest,
                    file_bytes,
                    big_endian,
                } => {
                    let place = Place::Byte((*file_bytes - rest.len()) as u64);
                    for (property, kept) in &properties {
                        let next = |scalar, _| next_bytes(rest, scalar, *big_endian);
                        if property.read(*kept, &mut numbers, next).is_none() {
                            let (count, name) = (element.count, &element.name);
                            let expected = format!("element {row} of {count} elements `{name}`");
                            return Err(reading.refuse(place, END_OF_FILE, expected));
                        }
                    }
                    place
                }
            };
            take(place, &numbers)?;
        }
        Ok(())
    }
}

impl Property {
    /// Reads the property of one element; `next` returns the next number, which is of no interest if it is not kept.
    fn read(
        &self,
        kept: bool,
        numbers: &mut Vec<f64>,
        mut next: impl FnMut(Scalar, bool) -> Option<f64>,
    ) -> Option<()> {
        let mut left = match self.count {
            Some(count) => next(count, true).filter(|count| *count >= 0.0)?,
            None => 1.0,
        };
        while left >= 1.0 {
            let number = next(self.scalar, kept)?;
            if kept {
                numbers.push(number);
            }
            left -= 1.0;
        }
        Some(())
    }

    fn expected(&self, element: &Element, kept: bool) -> String {
        let form = match (self.count, kept) {
            (None, false) => "a word",
            (None, true) if self.scalar.is_integer() => "an integer",
            (None, true) => "a number",
            (Some(_), false) => "a count and that many words",
            (Some(_), true) => "a count and that many integers",
        };
        format!(
            "property `{}` of element `{}` as {form}",
            self.name, element.name
        )
    }
}

/// Parses the next word. A word that is not kept may say anything: exporters write what does not fit the type.
fn next_word(words: &mut SplitAsciiWhitespace<'_>, scalar: Scalar, kept: bool) -> Option<f64> {
    let word = words.next()?;
    match (kept, scalar.is_integer()) {
        (false, _) => Some(0.0),
        (true, true) => word.parse::<i64>().ok().map(|integer| integer as f64),
        (true, false) => word.parse().ok(),
    }
}

fn next_bytes(rest: &mut &[u8], scalar: Scalar, big_endian: bool) -> Option<f64> {
    let (bytes, others) = rest.split_at_checked(scalar.bytes())?;
    *rest = others;
    let mut little = [0; 8];
    little[..bytes.len()].copy_from_slice(bytes);
    if big_endian {
        little[..bytes.len()].reverse();
    }
    let [a, b, c, d, ..] = little;
    Some(match scalar {
        Scalar::I8 => i8::from_le_bytes([a]).into(),
        Scalar::U8 => a.into(),
        Scalar::I16 => i16::from_le_bytes([a, b]).into(),
        Scalar::U16 => u16::from_le_bytes([a, b]).into(),
        Scalar::I32 => i32::from_le_bytes([a, b, c, d]).into(),
        Scalar::U32 => u32::from_le_bytes([a, b, c, d]).into(),
        Scalar::F32 => f32::from_le_bytes([a, b, c, d]).into(),
        Scalar::F64 => f64::from_le_bytes(little),
    })
}

#[cfg(test)]
mod tests {
    use super::super::parse_mesh;
    use crate::error::{IoError, Place};
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
                Err(IoError {
                    place: Some(Place::Line(line)),
                    ..
                }) => assert_eq!(line, at, "{body:?}"),
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
                Err(IoError {
                    place: Some(Place::Line(line)),
                    expected,
                    ..
                }) => {
                    assert_eq!(line, at, "{short}");
                    let named = format!("property `{property}` of ");
                    assert!(expected.starts_with(&named), "{expected}");
                }
                other => panic!("{short}: {other:?}"),
            }
        }
    }
}
