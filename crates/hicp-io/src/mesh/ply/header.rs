//! PLY headers: checked against the size of the file before anything is allocated by their word.

use std::collections::HashMap;
use std::path::Path;

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    self, DefaultElement, ElementDef, Encoding, Property, PropertyType, ScalarType,
};

use super::rows::VERTEX_NAMES;
use crate::error::{END_OF_FILE, IoError, Place};
use crate::source::text_bytes;

/// The longest header that is read. What the parser keeps of one takes a multiple of its size, so the size of the file is no bound.
const MAX_HEADER_BYTES: usize = 1 << 20;

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
    plain: Plain,
}

impl Header {
    /// Parses the header that `content` begins with, and holds its promises to `file_bytes`, the size of the whole file.
    pub(super) fn parse(path: &Path, content: &[u8], file_bytes: u64) -> Result<Self, IoError> {
        let text = text_bytes(path, content)?;
        let line_end = line_end(text);
        let plain = Plain::new(path, text, line_end)?;
        let bytes = content.len() - text.len() + plain.bytes;
        let lines = plain.text.lines().count();
        let parsed = Parser::<DefaultElement>::new()
            .read_header(&mut Reader::new(plain.text.as_bytes()))
            .map_err(|error| match error.line() {
                Some(line) => {
                    let mut given = text.split(|byte| *byte == line_end);
                    let found = given.nth(line.saturating_sub(1)).unwrap_or_default();
                    let found = String::from_utf8_lossy(found);
                    IoError::line(path, line, &found, "a line of a PLY 1.0 header")
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
            plain,
        };
        header.check_promises(path, file_bytes.saturating_sub(bytes as u64))?;
        Ok(header)
    }

    /// The line that announces an element.
    pub(super) fn place_of(&self, element: &str) -> Place {
        Place::Line(self.plain.elements.get(element).copied().unwrap_or(1))
    }

    /// What the file calls a property.
    pub(super) fn name_of<'a>(&'a self, property: &'a str) -> &'a str {
        self.plain
            .renamed
            .get(property)
            .map_or(property, |name| name)
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
        if element.count == 0 {
            return Ok(());
        }
        let is_list = name == FACE_LIST;
        let named = element
            .properties
            .values()
            .find(|property| property.name == name || is_list && is_face_list(&property.name));
        match named.map(|property| (&property.name, &property.data_type)) {
            Some((_, PropertyType::Scalar(_))) if !is_list => return Ok(()),
            Some((name, PropertyType::List(count, corner))) if is_list => {
                if is_integer(count) && is_integer(corner) {
                    return Ok(());
                }
                let (line, found) = self.property_line(&element.name, name);
                let expected = "integer types for the number of a face's corners and for each of them, as in `property list \
                     uchar int vertex_indices`";
                return Err(IoError::line(path, line, found, expected));
            }
            _ => {}
        }
        let names: Vec<&str> = element
            .properties
            .keys()
            .map(|name| self.name_of(name))
            .collect();
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

    /// The line that declares a property under its own name, and its number.
    fn property_line<'a>(&'a self, element: &str, property: &'a str) -> (usize, &'a str) {
        let announced = self.plain.elements.get(element).copied().unwrap_or(1);
        (1..)
            .zip(self.plain.text.lines())
            .skip(announced)
            .find(|(_, line)| line.split(' ').next_back() == Some(property))
            .unwrap_or((announced, property))
    }

    /// What to say of a file without an element `vertex`; the names of elements are case-sensitive.
    pub(super) fn without_vertices(&self, path: &Path) -> IoError {
        self.of_elements(path, "an element `vertex`")
    }

    fn of_elements(&self, path: &Path, expected: &'static str) -> IoError {
        let names: Vec<&String> = self.ply.elements.keys().collect();
        IoError::Unsupported {
            path: path.to_owned(),
            place: Place::Line(self.lines),
            found: format!("the elements {names:?}"),
            expected,
        }
    }

    /// What to say of a mesh of no triangles.
    pub(super) fn without_triangles(&self, path: &Path) -> IoError {
        match self.count_of("face") {
            (place, 0) if self.ply.elements.contains_key("face") => IoError::at(
                path,
                place,
                "element face 0",
                "a face of three corners or more: vertices alone are a point cloud, no mesh",
            ),
            (_, 0) => self.of_elements(
                path,
                "an element `face` with a face of three corners or more: vertices alone are a point cloud, no mesh",
            ),
            (place, count) => IoError::at(
                path,
                place,
                &format!("element face {count}"),
                "a face of three corners or more among them",
            ),
        }
    }
}

fn is_integer(scalar: &ScalarType) -> bool {
    !matches!(scalar, ScalarType::Float | ScalarType::Double)
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

/// A header in the words its grammar allows, line for line.
///
/// Comments come in any encoding, and property names with any characters and more than once. Neither matters here, so that a
/// property that nobody reads is renamed after its line: the parser keeps one property of a name and would read all that
/// follows out of step.
#[derive(Debug)]
struct Plain {
    text: String,
    /// Its length in the file.
    bytes: usize,
    /// The line of every element.
    elements: HashMap<String, usize>,
    /// What the file calls the renamed properties.
    renamed: HashMap<String, String>,
}

impl Plain {
    fn new(path: &Path, content: &[u8], line_end: u8) -> Result<Self, IoError> {
        let mut plain = Self {
            text: String::new(),
            bytes: 0,
            elements: HashMap::new(),
            renamed: HashMap::new(),
        };
        // The element that the next property is of, and the lines of those of its properties that are read.
        let mut element = String::new();
        let mut read = HashMap::new();
        for (number, line) in (1_usize..).zip(content.split_inclusive(|byte| *byte == line_end)) {
            if number == 1 && line.trim_ascii() != b"ply" {
                // What is no PLY file need not have lines.
                let start = String::from_utf8_lossy(&line[..line.len().min(256)]);
                return Err(IoError::line(path, 1, &start, "`ply`"));
            }
            plain.bytes += line.len();
            if plain.bytes > MAX_HEADER_BYTES {
                return Err(IoError::Line {
                    path: path.to_owned(),
                    line: number,
                    found: "a header that goes on".to_owned(),
                    expected: format!("`end_header` within the first {MAX_HEADER_BYTES} bytes"),
                });
            }
            let line = String::from_utf8_lossy(line);
            let twice = |what: &str, first: usize| {
                let expected = format!("no second {what}: line {first} declares one");
                IoError::line(path, number, &line, expected)
            };
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words.as_slice() {
                [] | ["comment" | "obj_info", ..] => plain.text.push_str("comment"),
                ["property", types @ .., name] => {
                    let what = match (element.as_str(), *name) {
                        ("vertex", name) if VERTEX_NAMES.contains(&name) => Some(name),
                        ("face", name) if is_face_list(name) => Some(FACE_LIST),
                        _ => None,
                    };
                    let name = match what {
                        Some(what) => {
                            if let Some(first) = read.insert(what.to_owned(), number) {
                                return Err(twice(&format!("`{what}` of a {element}"), first));
                            }
                            (*name).to_owned()
                        }
                        None => {
                            let plain_name = format!("p_{number}");
                            plain.renamed.insert(plain_name.clone(), (*name).to_owned());
                            plain_name
                        }
                    };
                    plain.text.push_str("property ");
                    for word in types {
                        plain.text.push_str(word);
                        plain.text.push(' ');
                    }
                    plain.text.push_str(&name);
                }
                words => {
                    if let ["element", name, ..] = words {
                        (*name).clone_into(&mut element);
                        read.clear();
                        if let Some(first) = plain.elements.insert(element.clone(), number) {
                            return Err(twice(&format!("element `{element}`"), first));
                        }
                    }
                    plain.text.push_str(&words.join(" "));
                }
            }
            plain.text.push('\n');
            if words == ["end_header"] {
                return Ok(plain);
            }
        }
        let lines = plain.text.lines().count();
        Err(IoError::line(
            path,
            lines.max(1),
            END_OF_FILE,
            "`end_header`",
        ))
    }
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

    #[test]
    fn properties_that_nobody_reads_may_have_any_names() {
        let names = [
            "w#1",
            "w%1",
            "w_1",
            "w_1",
            "1st",
            "h\u{f6}he",
            "nx",
            "p_4",
            "vertex_index",
        ];
        let properties: String = names
            .iter()
            .map(|name| format!("property uchar {name}\n"))
            .collect();
        let head = format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}");
        let header = parse(&format!("{head}end_header\n1 2 3 4 5 6 7 8 9\n")).unwrap();
        let vertex = &header.ply.elements["vertex"];
        let found: Vec<&str> = vertex
            .properties
            .keys()
            .map(|name| header.name_of(name))
            .collect();
        assert_eq!(found, names);
        assert!(vertex.properties.contains_key("nx"));
        // A byte too few for nine properties.
        assert!(matches!(
            parse(&format!("{head}end_header\n1 2 3 4 5 6 7 8")),
            Err(IoError::Promise { .. })
        ));
        let spaced = format!("{head}property float scalar field\nend_header\n");
        match parse(&spaced) {
            Err(IoError::Line { line, found, .. }) => {
                assert_eq!(
                    (line, found.as_str()),
                    (13, "\"property float scalar field\"")
                );
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_is_read_may_be_there_once() {
        let list = "property list uchar int";
        for (lines, second, first) in [
            (
                "element vertex 1\nproperty float x\nproperty float y\nproperty float x",
                6,
                4,
            ),
            (
                "element vertex 1\nproperty float nx\nproperty uchar nx",
                5,
                4,
            ),
            (
                &format!("element face 1\n{list} vertex_indices\n{list} vertex_indices"),
                5,
                4,
            ),
            (
                &format!("element face 1\n{list} vertex_indices\n\n{list} vertex_index"),
                6,
                4,
            ),
            (
                &format!(
                    "element face 1\n{list} vertex_index\nelement face 1\n{list} vertex_index"
                ),
                5,
                3,
            ),
            (
                "element odd 1\nproperty int a\nelement odd 1\nproperty int a",
                5,
                3,
            ),
        ] {
            let text = format!("ply\nformat ascii 1.0\n{lines}\nend_header\n1 2 3 4 5 6 7 8\n");
            match parse(&text) {
                Err(IoError::Line { line, expected, .. }) => {
                    assert_eq!(line, second, "{lines}");
                    assert!(expected.contains(&format!("line {first} ")), "{expected}");
                }
                other => panic!("{lines}: {other:?}"),
            }
        }
        // Other elements may have properties of these names.
        let elsewhere = format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nelement face 1\nproperty float x\n\
             property float x\n{list} vertex_index\nend_header\n1\n1 1 0\n"
        );
        assert!(parse(&elsewhere).is_ok());
    }

    #[test]
    fn a_header_has_an_end() {
        let head = "ply\nformat ascii 1.0\n";
        let tail = "end_header\n";
        let blank = "\n".repeat(MAX_HEADER_BYTES - head.len() - tail.len());
        assert!(parse(&format!("{head}{blank}{tail}")).is_ok());
        for text in [
            format!("{head}\n{blank}{tail}"),
            format!("{head}comment {}\n{tail}", "a".repeat(MAX_HEADER_BYTES)),
        ] {
            match parse(&text) {
                Err(error) => assert!(
                    error
                        .to_string()
                        .ends_with("expected `end_header` within the first 1048576 bytes"),
                    "{error}"
                ),
                Ok(header) => panic!("{} bytes", header.bytes),
            }
        }
    }

    #[test]
    fn a_byte_order_mark_counts_as_bytes_and_nothing_else() {
        let text = "ply\rformat ascii 1.0\rend_header\r";
        let header = parse(&format!("\u{feff}{text}")).unwrap();
        assert_eq!((header.bytes, header.lines), (text.len() + 3, 3));
        let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        for mark in [&b"\xfe\xff"[..], b""] {
            let content = [mark, &wide].concat();
            assert!(matches!(
                Header::parse(Path::new("a.ply"), &content, content.len() as u64),
                Err(IoError::Encoding {
                    found: "UTF-16 BE",
                    ..
                })
            ));
        }
    }

    #[test]
    fn corners_are_integers() {
        for (types, accepted) in [
            ("uchar int", true),
            ("int8 uint16", true),
            ("uchar float", false),
            ("double int", false),
        ] {
            let text = format!(
                "ply\nformat ascii 1.0\nelement odd 0\nproperty float vertex_index\nelement face 1\nproperty uchar a\n\
                 property list {types} vertex_index\nend_header\n0 3 0 1 2\n"
            );
            let header = parse(&text).unwrap();
            match header.require(Path::new("a"), &header.ply.elements["face"], FACE_LIST) {
                Ok(()) => assert!(accepted, "{types}"),
                Err(IoError::Line { line, found, .. }) => {
                    assert!(!accepted, "{types}");
                    assert_eq!(line, 7);
                    assert_eq!(found, format!("\"property list {types} vertex_index\""));
                }
                Err(other) => panic!("{other:?}"),
            }
        }
    }
}
