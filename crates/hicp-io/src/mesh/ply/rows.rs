//! The rows of a PLY file, which follow its header.

use std::ops::Range;
use std::str::SplitAsciiWhitespace;

use super::header::{Element, Encoding, Header, Property};
use crate::error::{END_OF_FILE, IoError, Place, quote};
use crate::mesh::lines::Lines;
use crate::mesh::raw::Reading;
use crate::number::NumberType;

/// The part of a file that is not read yet.
#[derive(Clone)]
pub(super) enum Rows<'a> {
    /// Text with one line per element: the current line, and its unread words.
    Ascii {
        lines: Lines<'a>,
        line: &'a str,
        words: SplitAsciiWhitespace<'a>,
    },
    Binary {
        rest: &'a [u8],
        file_bytes: usize,
        big_endian: bool,
    },
}

impl<'a> Rows<'a> {
    /// Starts at the end of a header. `text` is the rest of the file if it is text.
    pub(super) fn new(content: &'a [u8], text: &'a str, header: &Header) -> Self {
        match header.encoding {
            Encoding::Ascii => Self::Ascii {
                lines: Lines::after(header.lines, text),
                line: "",
                words: "".split_ascii_whitespace(),
            },
            encoding => Self::Binary {
                rest: &content[header.bytes..],
                file_bytes: content.len(),
                big_endian: encoding == Encoding::BigEndian,
            },
        }
    }

    /// Reads all elements of a kind.
    ///
    /// Calls `take` for each element with its place, the numbers of the properties whose slots are
    /// in `slots`, and the end of each property among them. A color or a texture coordinate in a
    /// text that is not a number is NaN.
    pub(super) fn read(
        &mut self,
        reading: &Reading<'_>,
        element: &Element,
        slots: &[Range<usize>],
        mut take: impl FnMut(Place, &[f64], &[usize]) -> Result<(), IoError>,
    ) -> Result<(), IoError> {
        let is_kept = |p: &Property| p.is_in(slots);
        let properties: Vec<_> = element.properties.iter().map(|p| (p, is_kept(p))).collect();
        let (mut numbers, mut ends) = (Vec::new(), Vec::new());
        for row in 0..element.count {
            numbers.clear();
            ends.clear();
            let place = self.start();
            for (property, kept) in &properties {
                if self.property(property, *kept, &mut numbers).is_some() {
                    if *kept {
                        ends.push(numbers.len());
                    }
                    continue;
                }
                let (count, name) = (element.count, &element.name);
                let (found, expected) = match self {
                    Self::Ascii { line, .. } if !line.is_empty() => {
                        (quote(line), property.expected(name, *kept))
                    }
                    _ => {
                        let expected = format!("element {row} of {count} elements `{name}`");
                        (END_OF_FILE.to_owned(), expected)
                    }
                };
                return Err(reading.refuse(place, found, expected));
            }
            take(place, &numbers, &ends)?;
        }
        Ok(())
    }

    /// Starts the next element and returns its place. At the end of a text, the line is empty.
    fn start(&mut self) -> Place {
        match self {
            Self::Ascii { lines, line, words } => {
                let next = lines.find(|line| !line.trim_ascii().is_empty());
                *line = next.unwrap_or_default();
                *words = line.split_ascii_whitespace();
                lines.place()
            }
            Self::Binary {
                rest, file_bytes, ..
            } => Place::Byte((*file_bytes - rest.len()) as u64),
        }
    }

    /// Reads a property of the current element; returns `None` if it is invalid.
    fn property(&mut self, property: &Property, kept: bool, numbers: &mut Vec<f64>) -> Option<()> {
        let mut left = match property.count {
            Some(count) => self
                .number(count, true, false)
                .filter(|count| *count >= 0.0)?,
            None => 1.0,
        };
        while left >= 1.0 {
            let number = self.number(property.scalar, kept, property.is_optional)?;
            if kept {
                numbers.push(number);
            }
            left -= 1.0;
        }
        Some(())
    }

    fn number(&mut self, scalar: NumberType, kept: bool, optional: bool) -> Option<f64> {
        match self {
            Self::Ascii { words, .. } => {
                let word = words.next()?;
                // A skipped number may be any word: exporters write values that do not fit the
                // type.
                if !kept {
                    return Some(0.0);
                }
                word.parse().ok().or(optional.then_some(f64::NAN))
            }
            Self::Binary {
                rest, big_endian, ..
            } => {
                let number = scalar.read(rest, *big_endian)?;
                *rest = &rest[scalar.bytes..];
                Some(number)
            }
        }
    }
}

impl Property {
    fn expected(&self, element: &str, kept: bool) -> String {
        let word = if kept { "number" } else { "word" };
        let form = match self.count {
            None => format!("a {word}"),
            Some(_) => format!("a count and that many {word}s"),
        };
        format!("property `{}` of element `{element}` as {form}", self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse_mesh;
    use crate::error::{IoError, Place};
    use crate::mesh::tests::reading;

    const HEAD: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property double z\nelement face 1\nproperty list uchar int vertex_indices\nproperty uchar red\nend_header\n";

    #[test]
    fn numbers_of_all_common_forms_are_read() {
        let text = format!("{HEAD}.5 1. +1e0\r\n\n  -.5\t0 0 99\n1 1 1E-3\n\n3 0 1 2 255");
        let mesh = parse_mesh(reading("a.ply"), text.into_bytes()).unwrap();
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
            match parse_mesh(reading("a.ply"), format!("{HEAD}{body}").into_bytes()) {
                Err(IoError {
                    place: Some(Place::Line(line)),
                    ..
                }) => assert_eq!(line, at, "{body:?}"),
                other => panic!("{body:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn line_endings_may_be_mixed() {
        for body in [
            "0 0 0\r1 0 0\r0 1 0\r3 0 1 2 0\r",
            "0 0 0\r\n1 0 0\r0 1 0\n\r\n3 0 1 2 0",
        ] {
            for head in [HEAD.to_owned(), HEAD.replace('\n', "\r")] {
                let text = format!("{head}{body}");
                let mesh = parse_mesh(reading("a.ply"), text.into_bytes()).unwrap();
                assert_eq!(mesh.vertices[1].coords.as_slice(), [1.0, 0.0, 0.0]);
                assert_eq!(mesh.triangles, [[0, 1, 2]]);
            }
        }
    }

    #[test]
    fn skipped_words_are_only_counted() {
        let head = "ply\nformat ascii 1.0\nelement odd 1\nproperty list uchar int ids\nelement vertex 3\n\
            property float nx\nproperty uchar red\nproperty float x\nproperty float y\nproperty float z\n\
            element face 1\nproperty list uchar uint rgba\nproperty list uchar int vertex_indices\n\
            property uchar a%1\nend_header\n";
        let body = "2 4294967295 x\n-nan(ind) 256 0 0 0\nnan 0.5 1 0 0\n1,5 red 0 1 0\n1 4294967295 3 0 1 2 -1\n";
        let mesh = parse_mesh(reading("a.ply"), format!("{head}{body}").into_bytes()).unwrap();
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
            match parse_mesh(reading("a.ply"), text.into_bytes()) {
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
