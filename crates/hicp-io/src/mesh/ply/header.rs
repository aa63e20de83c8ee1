//! PLY headers: checked against the size of the file before anything is allocated by their word.

use std::path::Path;

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    self, DefaultElement, ElementDef, Encoding, Property, PropertyType, ScalarType,
};

use crate::error::{END_OF_FILE, IoError, Place};

/// What the list of a face's corners is called; some exporters say `vertex_index`.
pub(super) const FACE_LIST: &str = "vertex_indices";

pub(super) fn is_face_list(name: &str) -> bool {
    matches!(name, "vertex_indices" | "vertex_index")
}

/// A header and how far it reaches.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) ply: ply::Header,
    pub(super) bytes: usize,
    pub(super) lines: usize,
    /// What ends its lines, and those of an ASCII payload.
    pub(super) line_end: u8,
    /// In characters that the grammar allows.
    text: String,
}

impl Header {
    /// Parses the header that `content` begins with, and holds its promises to `file_bytes`, the size of the whole file.
    pub(super) fn parse(path: &Path, content: &[u8], file_bytes: u64) -> Result<Self, IoError> {
        let line_end = line_end(content);
        let (text, bytes) = plain_header(path, content, line_end)?;
        let lines = text.lines().count();
        let parsed = Parser::<DefaultElement>::new()
            .read_header(&mut Reader::new(text.as_bytes()))
            .map_err(|error| match error.line() {
                Some(line) => {
                    let found = text.lines().nth(line.saturating_sub(1)).unwrap_or_default();
                    IoError::line(path, line, found, "a line of a PLY 1.0 header")
                }
                None => IoError::line(
                    path,
                    lines,
                    "end_header",
                    "a line `format ascii 1.0`, or another PLY format, before it",
                ),
            })?;
        let header = Self {
            ply: parsed,
            bytes,
            lines,
            line_end,
            text,
        };
        header.check_promises(path, file_bytes.saturating_sub(bytes as u64))?;
        Ok(header)
    }

    /// The line that announces an element.
    pub(super) fn place_of(&self, element: &str) -> Place {
        let announces = |line: &str| {
            let mut words = line.split_whitespace();
            words.next() == Some("element") && words.next() == Some(element)
        };
        Place::Line(1 + self.text.lines().position(announces).unwrap_or(0))
    }

    /// The number of elements of a name, and the line that announces them.
    pub(super) fn count_of(&self, name: &str) -> (Place, usize) {
        let count = self
            .ply
            .elements
            .get(name)
            .map_or(0, |element| element.count);
        (self.place_of(name), count)
    }

    /// Refuses counts that the rest of the file cannot hold.
    fn check_promises(&self, path: &Path, available: u64) -> Result<(), IoError> {
        let ascii = self.ply.encoding == Encoding::Ascii;
        // The last token of a file need not be followed by a separator.
        let mut left = available + u64::from(ascii);
        for element in self.ply.elements.values() {
            let least = element
                .properties
                .values()
                .map(|property| {
                    if ascii {
                        2
                    } else {
                        least_bytes(&property.data_type)
                    }
                })
                .sum::<u64>()
                .max(1);
            let count = element.count as u64;
            let needed = least.saturating_mul(count);
            if needed > left {
                return Err(IoError::Promise {
                    path: path.to_owned(),
                    place: self.place_of(&element.name),
                    what: format!("elements `{}`", element.name),
                    count,
                    needed,
                    available: left,
                });
            }
            left -= needed;
        }
        Ok(())
    }

    /// Refuses an element without a property it cannot do without.
    pub(super) fn require(
        &self,
        path: &Path,
        element: &ElementDef,
        name: &'static str,
    ) -> Result<(), IoError> {
        let is_list = name == FACE_LIST;
        let present = element.properties.values().any(|property| {
            let named = property.name == name || is_list && is_face_list(&property.name);
            named && is_list == matches!(property.data_type, PropertyType::List(..))
        });
        if present || element.count == 0 {
            return Ok(());
        }
        let names: Vec<&str> = element.properties.keys().map(String::as_str).collect();
        Err(IoError::Unsupported {
            path: path.to_owned(),
            place: self.place_of(&element.name),
            found: format!("an element `{}` with properties {names:?}", element.name),
            expected: match name {
                FACE_LIST => "a list property `vertex_indices` or `vertex_index`",
                _ => "properties `x`, `y` and `z`",
            },
        })
    }
}

fn least_bytes(data_type: &PropertyType) -> u64 {
    match data_type {
        PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => match scalar {
            ScalarType::Char | ScalarType::UChar => 1,
            ScalarType::Short | ScalarType::UShort => 2,
            ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
            ScalarType::Double => 8,
        },
    }
}

/// Parses one ASCII scalar of a type; integers may not have a fraction.
pub(super) fn parse_scalar(text: &str, scalar: &ScalarType) -> Option<Property> {
    Some(match scalar {
        ScalarType::Char => Property::Char(text.parse().ok()?),
        ScalarType::UChar => Property::UChar(text.parse().ok()?),
        ScalarType::Short => Property::Short(text.parse().ok()?),
        ScalarType::UShort => Property::UShort(text.parse().ok()?),
        ScalarType::Int => Property::Int(text.parse().ok()?),
        ScalarType::UInt => Property::UInt(text.parse().ok()?),
        // In text both are decimals: nothing is gained by rounding one of them early.
        ScalarType::Float | ScalarType::Double => Property::Double(text.parse().ok()?),
    })
}

/// Returns the byte that ends the lines: a carriage return where the first line has no other end, as files of old do.
fn line_end(content: &[u8]) -> u8 {
    match content.strip_prefix(b"ply") {
        Some([b'\r', next, ..]) if *next != b'\n' => b'\r',
        _ => b'\n',
    }
}

/// Returns the header in the characters its grammar allows, line for line, and its length in bytes.
///
/// Comments come in any encoding and some exporters put punctuation into property names; neither matters here.
fn plain_header(path: &Path, content: &[u8], line_end: u8) -> Result<(String, usize), IoError> {
    let mut text = String::new();
    let mut bytes = 0;
    for (number, line) in (1_usize..).zip(content.split_inclusive(|byte| *byte == line_end)) {
        bytes += line.len();
        let line = String::from_utf8_lossy(line);
        let line = line.trim();
        if number == 1 && line != "ply" {
            return Err(IoError::line(path, 1, line, "`ply`"));
        }
        let mut words = line.split_whitespace();
        match words.next() {
            Some("comment" | "obj_info") | None => text.push_str("comment"),
            Some("property") => {
                let name = words.next_back().unwrap_or_default();
                text.push_str("property");
                for word in words {
                    text.push(' ');
                    text.push_str(word);
                }
                text.push(' ');
                text.extend(
                    name.chars()
                        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }),
                );
            }
            Some(_) => text.push_str(line),
        }
        text.push('\n');
        if line == "end_header" {
            return Ok((text, bytes));
        }
    }
    let lines = text.lines().count();
    Err(IoError::line(
        path,
        lines.max(1),
        END_OF_FILE,
        "`end_header`",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Header, IoError> {
        Header::parse(Path::new("a.ply"), text.as_bytes(), text.len() as u64)
    }

    #[test]
    fn terabytes_are_refused_before_allocating() {
        for (format, what) in [
            ("ascii", "element vertex 1000000000000\nproperty float x\n"),
            (
                "ascii",
                "element vertex 18446744073709551615\nproperty float x\n",
            ),
            (
                "binary_little_endian",
                "element face 1000000000000\nproperty list uchar int vertex_indices\n",
            ),
            ("binary_big_endian", "element empty 1000000000000\n"),
        ] {
            let text = format!("ply\nformat {format} 1.0\n{what}end_header\n1 2 3\n");
            assert!(
                matches!(parse(&text), Err(IoError::Promise { .. })),
                "{what}"
            );
        }
    }

    #[test]
    fn the_least_that_a_file_can_hold_is_accepted() {
        let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nend_header\n";
        assert!(parse(&format!("{head}1 2\n3 4")).is_ok());
        assert!(matches!(
            parse(&format!("{head}1 2\n3 ")),
            Err(IoError::Promise { .. })
        ));
    }

    #[test]
    fn broken_headers_name_the_line() {
        for (text, at) in [
            ("", 1),
            ("plx\n", 1),
            ("ply\n", 1),
            ("ply\nformat ascii 1.0\nelement vertex 3\n", 3),
            (
                "ply\nformat ascii 1.0\nelement vertex three\nend_header\n",
                3,
            ),
            ("ply\nformat utf8 1.0\nend_header\n", 2),
            ("ply\nproperty float x\nend_header\n", 2),
            ("ply\nelement vertex 3\nend_header\n", 3),
        ] {
            match parse(text) {
                Err(IoError::Line { line, .. }) => assert_eq!(line, at, "{text:?}"),
                other => panic!("{text:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn a_vertex_without_z_is_refused() {
        let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n";
        let header = parse(text).unwrap();
        let vertex = &header.ply.elements["vertex"];
        assert!(header.require(Path::new("a"), vertex, "x").is_ok());
        assert!(matches!(
            header.require(Path::new("a"), vertex, "z"),
            Err(IoError::Unsupported { .. })
        ));
    }
}
