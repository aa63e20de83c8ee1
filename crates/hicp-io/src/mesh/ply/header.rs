//! Parses PLY headers and checks element counts against the file size before allocating.

use std::ops::Range;
use std::path::Path;

use crate::error::{END_OF_FILE, IoError, Place, quote};
use crate::number::{Kind, NumberType};
use crate::source::text_bytes;

/// The largest accepted size of a header, in bytes.
///
/// The memory for its elements is a multiple of its size, so the size of the file is not a
/// sufficient bound.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// The properties of a vertex that points need: its position and its normal.
pub(super) const VERTEX_NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// The names of the other properties of a vertex that are read: its color and its place in the
/// texture.
const OPTIONAL_NAMES: [&[&str]; 5] = [
    &["red", "diffuse_red", "r"],
    &["green", "diffuse_green", "g"],
    &["blue", "diffuse_blue", "b"],
    &["texture_u", "u", "s"],
    &["texture_v", "v", "t"],
];

/// The slots of a vertex's color.
pub(super) const COLOR_SLOTS: Range<usize> = 6..9;
/// The slots of a vertex's texture coordinates.
pub(super) const TEXTURE_SLOTS: Range<usize> = 9..11;
/// The slot of the texture coordinates of a face: two numbers per corner.
pub(super) const FACE_TEXTURE: usize = 1;
/// The slot of the number of a face's texture.
pub(super) const FACE_IMAGE: usize = 2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Returns the type of numbers of a name.
fn number_type(name: &str) -> Result<NumberType, String> {
    let (kind, bytes) = match name {
        "char" | "int8" => (Kind::Signed, 1),
        "uchar" | "uint8" => (Kind::Unsigned, 1),
        "short" | "int16" => (Kind::Signed, 2),
        "ushort" | "uint16" => (Kind::Unsigned, 2),
        "int" | "int32" => (Kind::Signed, 4),
        "uint" | "uint32" => (Kind::Unsigned, 4),
        "float" | "float32" => (Kind::Float, 4),
        "double" | "float64" => (Kind::Float, 8),
        _ => return Err(grammar()),
    };
    Ok(NumberType { kind, bytes })
}

/// A value that each element of a kind has: a number or a list of numbers.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    /// The type of the length of a list; `None` if the property is a single number.
    pub(super) count: Option<NumberType>,
    pub(super) scalar: NumberType,
    /// The position at which a reader stores the values.
    ///
    /// It is 0 to 5 for [`VERTEX_NAMES`], the next numbers are for [`OPTIONAL_NAMES`]. It is 0 for
    /// the corners of a face, and `None` if the property is skipped.
    pub(super) slot: Option<usize>,
    /// `true` if a value in a text may be any word.
    pub(super) is_optional: bool,
    line: usize,
}

impl Property {
    /// Returns whether the values are stored at one of these slots.
    pub(super) fn is_in(&self, slots: &[Range<usize>]) -> bool {
        let holds = |slot| slots.iter().any(|slots| slots.contains(&slot));
        self.slot.is_some_and(holds)
    }
}

/// A kind of elements, such as vertices.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
    /// The line of its declaration.
    pub(super) line: usize,
}

impl Element {
    /// Returns an error if the properties of the first `slots` slots are not all declared.
    pub(super) fn require(&self, path: &Path, slots: usize, expected: &str) -> Result<(), IoError> {
        let properties = &self.properties;
        let has = |slot| properties.iter().any(|p| p.slot == Some(slot));
        if self.count == 0 || (0..slots).all(has) {
            return Ok(());
        }
        let names: Vec<&str> = properties.iter().map(|p| &*p.name).collect();
        let found = format!("an element `{}` with properties {names:?}", self.name);
        Err(IoError::new(path, Place::Line(self.line), found, expected))
    }

    /// Returns the smallest possible size of an element, in bytes.
    fn least_bytes(&self, encoding: Encoding) -> u64 {
        let least = |p: &Property| match encoding {
            Encoding::Ascii => 2,
            _ => p.count.unwrap_or(p.scalar).bytes as u64,
        };
        self.properties.iter().map(least).sum::<u64>().max(1)
    }
}

/// A parsed header and its size.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// The names of the texture files, from comments `TextureFile`.
    pub(super) textures: Vec<String>,
    pub(super) bytes: usize,
    pub(super) lines: usize,
}

impl Header {
    /// Parses the header at the start of `content` and checks its counts against `file_bytes`.
    pub(super) fn parse(path: &Path, content: &[u8], file_bytes: u64) -> Result<Self, IoError> {
        let text = text_bytes(path, content)?;
        // Old files end lines with a carriage return only.
        let end = match text {
            [b'p', b'l', b'y', b'\r', next, ..] if *next != b'\n' => b'\r',
            _ => b'\n',
        };
        let (mut encoding, mut elements, mut textures) = (None, Vec::new(), Vec::new());
        let (mut bytes, mut lines) = (content.len() - text.len(), 0);
        for line in text.split_inclusive(|byte| *byte == end) {
            (bytes, lines) = (bytes + line.len(), lines + 1);
            // A file of another format may be a single long line.
            let shown = quote(&String::from_utf8_lossy(&line[..line.len().min(256)]));
            let refuse = |expected| IoError::new(path, Place::Line(lines), &*shown, expected);
            if lines == 1 && line.trim_ascii() != b"ply" {
                return Err(refuse("`ply`".to_owned()));
            }
            if bytes > MAX_HEADER_BYTES {
                let expected = format!("`end_header` within the first {MAX_HEADER_BYTES} bytes");
                return Err(refuse(expected));
            }
            let line = String::from_utf8_lossy(line);
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            if let ["comment", "TextureFile", _, ..] = words[..] {
                let name = line.split_once("TextureFile").map_or("", |(_, name)| name);
                textures.push(name.trim().to_owned());
            }
            declare(&words, lines, &mut encoding, &mut elements).map_err(refuse)?;
            if words == ["end_header"] {
                let expected = "a line `format ascii 1.0`, or another PLY format, before it";
                let encoding = encoding.ok_or_else(|| refuse(expected.to_owned()))?;
                let header = Self {
                    encoding,
                    elements,
                    textures,
                    bytes,
                    lines,
                };
                header.check_promises(path, file_bytes.saturating_sub(bytes as u64))?;
                return Ok(header);
            }
        }
        let place = Place::Line(lines.max(1));
        Err(IoError::new(path, place, END_OF_FILE, "`end_header`"))
    }

    /// Returns an error for counts that the rest of the file cannot hold.
    fn check_promises(&self, path: &Path, available: u64) -> Result<(), IoError> {
        // The last word of a text may have no separator after it.
        let mut left = available + u64::from(self.encoding == Encoding::Ascii);
        for element in &self.elements {
            let (place, count) = (Place::Line(element.line), element.count as u64);
            let needed = element.least_bytes(self.encoding).saturating_mul(count);
            let what = format!("elements `{}`", element.name);
            IoError::check_promise(path, place, (count, &what), needed, left)?;
            left -= needed;
        }
        Ok(())
    }

    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|element| element.name == name)
    }
}

fn grammar() -> String {
    "a line of a PLY 1.0 header".to_owned()
}

/// Parses a line of a header. The error is the expected text.
fn declare(
    words: &[&str],
    line: usize,
    encoding: &mut Option<Encoding>,
    elements: &mut Vec<Element>,
) -> Result<(), String> {
    let (name, count, scalar) = match *words {
        ["format", format, "1.0"] => {
            *encoding = Some(match format {
                "ascii" => Encoding::Ascii,
                "binary_little_endian" => Encoding::LittleEndian,
                "binary_big_endian" => Encoding::BigEndian,
                _ => return Err(grammar()),
            });
            return Ok(());
        }
        ["element", name, count] => {
            if let Some(Element { line, .. }) = elements.iter().find(|e| e.name == name) {
                return Err(format!(
                    "no second element `{name}`: line {line} declares one"
                ));
            }
            elements.push(Element {
                name: name.to_owned(),
                count: count.parse().map_err(|_| grammar())?,
                properties: Vec::new(),
                line,
            });
            return Ok(());
        }
        ["property", "list", count, scalar, name] => (name, Some(count), scalar),
        ["property", scalar, name] => (name, None, scalar),
        [] | ["ply" | "comment" | "obj_info", ..] | ["end_header"] => return Ok(()),
        _ => return Err(grammar()),
    };
    let count = count.map(number_type).transpose()?;
    let element = elements.last_mut().ok_or_else(grammar)?;
    let slot = match (&*element.name, name, count) {
        ("vertex", _, None) => {
            let required = VERTEX_NAMES.iter().position(|known| *known == name);
            let optional = || {
                OPTIONAL_NAMES
                    .iter()
                    .position(|names| names.contains(&name))
            };
            required.or_else(|| optional().map(|index| COLOR_SLOTS.start + index))
        }
        ("face", "vertex_indices" | "vertex_index", Some(_)) => Some(0),
        ("face", "texcoord", Some(_)) => Some(FACE_TEXTURE),
        ("face", "texnumber", None) => Some(FACE_IMAGE),
        _ => None,
    };
    let mut others = element.properties.iter();
    let first = others.find(|other| slot.is_some() && other.slot == slot);
    let required = if element.name == "face" {
        0..1
    } else {
        0..COLOR_SLOTS.start
    };
    let is_optional = slot.is_some_and(|slot| !required.contains(&slot));
    // A second color is skipped; a second position or normal would be ambiguous.
    let slot = slot.filter(|_| first.is_none());
    if let Some(first) = first.filter(|_| !is_optional) {
        let (element, line) = (&element.name, first.line);
        return Err(format!(
            "no second `{name}` of a {element}: line {line} declares one"
        ));
    }
    element.properties.push(Property {
        name: name.to_owned(),
        count,
        scalar: number_type(scalar)?,
        slot,
        is_optional,
        line,
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::IoErrorKind;

    fn parse(text: &str) -> Result<Header, IoError> {
        Header::parse(Path::new("a.ply"), text.as_bytes(), text.len() as u64)
    }

    #[test]
    fn a_file_of_the_smallest_possible_size_is_accepted() {
        let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nend_header\n";
        assert!(parse(&format!("{head}1 2\n3 4")).is_ok());
        assert!(matches!(
            parse(&format!("{head}1 2\n3 ")),
            Err(IoError { found, .. }) if found.contains("promises")
        ));
    }

    #[test]
    fn errors_name_the_line_of_the_header() {
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
                Err(IoError {
                    place: Some(Place::Line(line)),
                    ..
                }) => assert_eq!(line, at, "{text:?}"),
                other => panic!("{text:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn a_vertex_without_z_is_refused() {
        let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n";
        let header = parse(text).unwrap();
        let vertex = header.element("vertex").unwrap();
        let require = |slots| vertex.require(Path::new("a"), slots, "a position");
        assert!(require(2).is_ok());
        let error = require(3).unwrap_err();
        assert!(error.found.contains("properties [\"x\", \"y\"]"), "{error}");
    }

    #[test]
    fn skipped_properties_may_have_any_names() {
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
        let vertex = header.element("vertex").unwrap();
        let found: Vec<&str> = vertex.properties.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(found, names);
        // One byte too few for nine properties.
        assert!(matches!(
            parse(&format!("{head}end_header\n1 2 3 4 5 6 7 8")),
            Err(IoError { found, .. }) if found.contains("promises")
        ));
        let spaced = format!("{head}property float scalar field\nend_header\n");
        match parse(&spaced) {
            Err(IoError {
                found,
                place: Some(Place::Line(line)),
                ..
            }) => {
                assert_eq!(
                    (line, found.as_str()),
                    (13, "\"property float scalar field\"")
                );
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn properties_that_are_read_must_be_unique() {
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
                Err(IoError {
                    expected,
                    place: Some(Place::Line(line)),
                    ..
                }) => {
                    assert_eq!(line, second, "{lines}");
                    assert!(expected.contains(&format!("line {first} ")), "{expected}");
                }
                other => panic!("{lines}: {other:?}"),
            }
        }
        // Other elements may repeat properties of these names.
        let elsewhere = format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nelement face 1\nproperty float x\n\
             property float x\n{list} vertex_index\nend_header\n1\n1 1 0\n"
        );
        assert!(parse(&elsewhere).is_ok());
    }

    #[test]
    fn a_header_without_end_is_refused() {
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
    fn a_byte_order_mark_counts_as_bytes_only() {
        let text = "ply\rformat ascii 1.0\rend_header\r";
        let header = parse(&format!("\u{feff}{text}")).unwrap();
        assert_eq!((header.bytes, header.lines), (text.len() + 3, 3));
        let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        for mark in [&b"\xfe\xff"[..], b""] {
            let content = [mark, &wide].concat();
            assert!(matches!(
                Header::parse(Path::new("a.ply"), &content, content.len() as u64),
                Err(IoError {
                    kind: IoErrorKind::Encoding,
                    found,
                    ..
                }) if found.contains("UTF-16 BE")
            ));
        }
    }
}
