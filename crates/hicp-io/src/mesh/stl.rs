//! STL files, ASCII and binary.
//!
//! This crate has its own parser because files in use often break other readers. Other readers stop
//! at the first `endsolid`, and refuse `solid` without a name and facet normals that are not
//! finite. They classify binary files as text by the first word of the header, and do not report
//! the place of an error.
//!
//! Normals are not read: the winding of the corners defines them.

use super::lines::Lines;
use super::raw::{FACE, RawMesh, Reading};
use crate::error::{END_OF_FILE, IoError, Place, quote};
use crate::limits::Limit;
use crate::number::F32;
use crate::source::text_bytes;

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;
/// The place of the number of triangles in a binary file.
const COUNT: Place = Place::Byte(80);
/// The expected text for a file that is neither text nor binary.
const START: &str = "`solid`, or a binary header of 84 bytes";

/// Returns an error if the header of a complete binary file announces too many triangles.
pub(super) fn check_head(reading: &Reading<'_>, head: &[u8], bytes: u64) -> Result<(), IoError> {
    match triangle_count(head) {
        Some(count) if fits(count, bytes) => reading.check(Limit::TRIANGLES, COUNT, count as usize),
        _ => Ok(()),
    }
}

/// Parses an STL file. Vertices at the same position become one.
pub(super) fn parse(reading: Reading<'_>, content: Vec<u8>) -> Result<RawMesh<'_>, IoError> {
    // Check the size first: a binary file may start with any 80 bytes, such as `solid` or bytes
    // that look like UTF-16.
    if triangle_count(&content).is_some_and(|count| fits(count, content.len() as u64)) {
        return parse_binary(reading, &content);
    }
    let text = text_bytes(reading.path, &content)?;
    // Some programs fill the last block of a text with zeros. A truncated binary header may end
    // with zeros, too.
    let filling = text.iter().rev().take_while(|byte| **byte == 0).count();
    let text = match &text[..text.len() - filling] {
        filled if filled.len() > HEADER_BYTES => filled,
        _ => text,
    };
    match is_text(text) {
        true => parse_ascii(reading, &String::from_utf8_lossy(text)),
        false => parse_binary(reading, &content),
    }
}

/// Distinguishes text from a truncated binary file, whose count contains a 0 or another byte that
/// text cannot contain.
fn is_text(content: &[u8]) -> bool {
    let start = &content[..content.len().min(512)];
    let solid = start.trim_ascii_start().get(..5);
    let is_solid = solid.is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let breaks = |byte: &u8| byte.is_ascii_control() && !byte.is_ascii_whitespace();
    !start.is_empty() && !start.contains(&0) && (is_solid || !start.iter().any(breaks))
}

fn triangle_count(content: &[u8]) -> Option<u32> {
    let bytes = content[..content.len().min(HEADER_BYTES)].last_chunk()?;
    (content.len() >= HEADER_BYTES).then_some(u32::from_le_bytes(*bytes))
}

/// Returns whether a file has the size of a binary one.
///
/// A few bytes of padding are accepted; the size of another triangle is not.
fn fits(count: u32, bytes: u64) -> bool {
    let needed = HEADER_BYTES as u64 + u64::from(count) * TRIANGLE_BYTES as u64;
    (needed..needed + TRIANGLE_BYTES as u64).contains(&bytes)
}

fn parse_binary<'a>(reading: Reading<'a>, content: &[u8]) -> Result<RawMesh<'a>, IoError> {
    let Some(count) = triangle_count(content) else {
        let end = Place::Byte(content.len() as u64);
        return Err(reading.refuse(end, END_OF_FILE, START));
    };
    let body = &content[HEADER_BYTES..];
    let (needed, left) = (u64::from(count) * TRIANGLE_BYTES as u64, body.len() as u64);
    let promise = (count.into(), "triangles");
    IoError::check_promise(reading.path, COUNT, promise, needed, left)?;
    let there = body.len() / TRIANGLE_BYTES;
    let found = format!("a count of {count} triangles");
    if there > count as usize {
        let expected = format!("{there}, which the file has bytes for");
        return Err(reading.refuse(COUNT, found, expected));
    }
    reading.check(Limit::TRIANGLES, COUNT, there)?;
    let mut mesh = RawMesh::new(reading, reading.refuse(COUNT, found, FACE));
    mesh.triangles.reserve_exact(there);
    for (start, triangle) in (HEADER_BYTES..)
        .step_by(TRIANGLE_BYTES)
        .zip(body.chunks_exact(TRIANGLE_BYTES))
    {
        let mut corners = [0; 3];
        // The normal comes first.
        for (offset, index) in [12, 24, 36].into_iter().zip(&mut corners) {
            let coordinate = |axis| F32.read(&triangle[offset + axis..], false);
            let position = [0, 4, 8].map(|axis| coordinate(axis).unwrap_or(f64::NAN));
            let place = Place::Byte((start + offset) as u64);
            *index = mesh.weld(place, position)?;
        }
        mesh.triangles.push(corners);
    }
    Ok(mesh)
}

fn parse_ascii<'a>(reading: Reading<'a>, text: &str) -> Result<RawMesh<'a>, IoError> {
    let mut words = Words {
        reading,
        lines: Lines::new(text),
        rest: "",
    };
    let mut mesh = RawMesh::new(reading, reading.refuse(Place::Line(1), END_OF_FILE, FACE));
    words.expect("solid", START)?;
    words.skip_name();
    // A file without its last line may have lost any number of facets.
    let mut open = true;
    while let Some(word) = words.next() {
        if word.is("facet") {
            open = true;
            let corners = parse_facet(&mut words, &mut mesh)?;
            mesh.add_face(word.place, &corners)?;
        } else if word.is("solid") || word.is("endsolid") {
            open = word.is("solid");
            words.skip_name();
        } else {
            return Err(words.refuse(Some(word), "`facet`, `endsolid` or `solid`"));
        }
    }
    if open {
        return Err(words.refuse(None, "`endsolid`"));
    }
    mesh.empty = words.refuse(None, FACE);
    Ok(mesh)
}

/// The keywords that follow `facet`, and the expected texts.
const FACET: [(&str, &str); 8] = [
    ("normal", "`normal` and three components"),
    ("outer", "`outer loop`"),
    ("loop", "`outer loop`"),
    (
        "vertex",
        "the first `vertex` of three and its three numbers",
    ),
    (
        "vertex",
        "the second `vertex` of three and its three numbers",
    ),
    (
        "vertex",
        "the third `vertex` of three and its three numbers",
    ),
    ("endloop", "`endloop` after three vertices"),
    ("endfacet", "`endfacet`"),
];

/// Parses the words after `facet`.
fn parse_facet(words: &mut Words<'_>, mesh: &mut RawMesh<'_>) -> Result<[u32; 3], IoError> {
    let (mut corners, mut corner) = ([0; 3], 0);
    for (keyword, expected) in FACET {
        let word = words.expect(keyword, expected)?;
        match keyword {
            "normal" => {
                // Some programs write arbitrary words for a normal without a direction.
                for _ in 0..3 {
                    match words.next() {
                        Some(component) if !component.is("outer") => {}
                        other => return Err(words.refuse(other, expected)),
                    }
                }
            }
            "vertex" => {
                let mut position = [0.0; 3];
                for value in &mut position {
                    let number = words.next().and_then(|word| word.text.parse().ok());
                    *value = number.ok_or_else(|| words.refuse(Some(word.clone()), expected))?;
                }
                corners[corner] = mesh.weld(word.place, position)?;
                corner += 1;
            }
            _ => {}
        }
    }
    Ok(corners)
}

/// The words of a text. Line breaks count as spaces, except after a name.
#[derive(Clone, Debug)]
struct Words<'a> {
    reading: Reading<'a>,
    lines: Lines<'a>,
    /// The unread rest of the current line.
    rest: &'a str,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<Word<'a>> {
        loop {
            if let Some(word) = self.next_of_line() {
                return Some(word);
            }
            self.rest = self.lines.next()?;
        }
    }

    fn next_of_line(&mut self) -> Option<Word<'a>> {
        let from = self.rest.trim_start();
        let text = from.split_whitespace().next()?;
        self.rest = &from[text.len()..];
        let place = self.lines.place();
        Some(Word { text, from, place })
    }

    /// Skips the name in the rest of the line.
    ///
    /// Stops at a facet or `endsolid`, which some programs write on the same line.
    fn skip_name(&mut self) {
        let mut ahead = self.clone();
        while let Some(word) = ahead.next_of_line() {
            let next = ahead.clone().next_of_line();
            let is_facet = word.is("facet") && next.is_some_and(|next| next.is("normal"));
            if word.is("endsolid") || is_facet {
                return;
            }
            self.rest = ahead.rest;
        }
    }

    fn expect(&mut self, keyword: &str, expected: &str) -> Result<Word<'a>, IoError> {
        match self.next() {
            Some(word) if word.is(keyword) => Ok(word),
            other => Err(self.refuse(other, expected)),
        }
    }

    /// Returns the error for a word, or for the end of the file.
    fn refuse(&self, found: Option<Word<'_>>, expected: &str) -> IoError {
        let end = || (self.lines.place(), END_OF_FILE.to_owned());
        let (place, found) = found.map_or_else(end, |word| (word.place, quote(word.from)));
        self.reading.refuse(place, found, expected)
    }
}

#[derive(Clone, Debug)]
struct Word<'a> {
    text: &'a str,
    /// The rest of its line, starting with the word.
    from: &'a str,
    place: Place,
}

impl Word<'_> {
    fn is(&self, keyword: &str) -> bool {
        self.text.eq_ignore_ascii_case(keyword)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::IoErrorKind;

    use crate::mesh::tests::reading;

    fn read(content: &[u8]) -> Result<RawMesh<'static>, IoError> {
        parse(reading("a.stl"), content.to_vec())
    }

    fn binary(title: &[u8], count: u32, triangles: usize) -> Vec<u8> {
        let mut content = title.to_vec();
        content.resize(80, b' ');
        content.extend(count.to_le_bytes());
        for triangle in 0..triangles {
            for corner in 0..4_u8 {
                for axis in 0..3_u8 {
                    let value = if corner == axis + 1 {
                        1.0 + triangle as f32
                    } else {
                        0.0
                    };
                    content.extend(value.to_le_bytes());
                }
            }
            content.extend([0, 0]);
        }
        content
    }

    #[test]
    fn binary_files_are_recognized_by_size_for_any_header() {
        for title in [&b"solid but binary"[..], b"made by hand"] {
            let mesh = read(&binary(title, 2, 2)).unwrap();
            assert_eq!((mesh.triangles.len(), mesh.vertices.len()), (2, 6));
        }
        let mut trailing = binary(b"x", 1, 1);
        trailing.extend([1, 2, 3]);
        assert_eq!(read(&trailing).unwrap().triangles.len(), 1);
    }

    #[test]
    fn truncated_binary_files_and_wrong_counts_are_refused() {
        let mut truncated = binary(b"solid", 2, 2);
        truncated.pop();
        for content in [truncated, binary(b"x", u32::MAX, 1), binary(b"solid", 3, 2)] {
            assert!(
                matches!(read(&content), Err(IoError { found, .. }) if found.contains("promises"))
            );
        }
        for content in [&b""[..], b"a\x01c", &[0; 83]] {
            assert!(matches!(
                read(content),
                Err(IoError {
                    place: Some(Place::Byte(_)),
                    ..
                })
            ));
        }
    }

    #[test]
    fn binary_files_with_a_header_that_looks_like_text_are_read() {
        for title in [
            &b"\xff\xfeA\0B\0"[..],
            b"A\0B\0",
            b"\0A\0B",
            b"\xef\xbb\xbfx",
        ] {
            let mut content = binary(title, 2, 2);
            assert_eq!(read(&content).unwrap().triangles.len(), 2);
            content.push(0);
            assert_eq!(read(&content).unwrap().triangles.len(), 2);
        }
        let text = "\u{feff}solid".encode_utf16().flat_map(u16::to_le_bytes);
        assert!(matches!(
            parse(reading("a.stl"), text.collect()),
            Err(IoError {
                kind: IoErrorKind::Encoding,
                ..
            })
        ));
    }

    #[test]
    fn errors_quote_the_line_of_text_that_does_not_start_with_solid() {
        let html = format!("<html>{}", "x".repeat(200));
        let mesh = format!("{FACET}endsolid\n");
        let comment = format!("\n; M\u{fc}ller\nsolid\n{FACET}endsolid\n");
        for (text, at, what) in [
            ("abc", 1, "\"abc\""),
            ("solids\n", 1, "\"solids\""),
            (" \n\n", 2, END_OF_FILE),
            (&mesh, 1, "\"facet normal nan nan nan\""),
            (&comment, 2, "\"; M\u{fc}ller\""),
            (&html, 1, &format!("{:?}...", &html[..60])),
        ] {
            match read(text.as_bytes()) {
                Err(IoError {
                    found,
                    expected,
                    place: Some(Place::Line(line)),
                    ..
                }) => {
                    assert_eq!((line, found.as_str()), (at, what));
                    assert!(expected.starts_with("`solid`"), "{expected}");
                }
                other => panic!("{text:?}: {other:?}"),
            }
        }
    }

    const FACET: &str = "facet normal nan nan nan\nouter loop\nvertex 0 0 0\nvertex 1 0 -0.0\nvertex 0 1 0\nendloop\nendfacet\n";

    #[test]
    fn ascii_solids_are_merged_and_vertices_welded() {
        let text = format!(
            "\u{feff}solid\n{FACET}endsolid\nSOLID b\nendsolid b\nsolid c\n{FACET}endsolid"
        );
        let mesh = read(text.as_bytes()).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.vertices.len()), (2, 3));
    }

    #[test]
    fn ascii_words_may_be_on_any_line() {
        let line = FACET.replace('\n', " ");
        let words = FACET.replace(' ', "\n");
        for (text, count) in [
            (format!("solid x\n{line}\n{FACET}endsolid"), 2),
            (format!("solid x\n{FACET}{line}\nendsolid"), 2),
            (format!("solid x\n{words}{line}endsolid x"), 2),
            (
                format!(
                    "solid x\n{}{FACET}endsolid x",
                    FACET.replacen("endfacet\n", "endfacet ", 1)
                ),
                2,
            ),
            (format!("solid x {line}\n{FACET}endsolid x"), 2),
            (format!("solid {line}{line} endsolid x"), 2),
            (
                format!("solid x\n{FACET}endsolid x solid y {line}endsolid y"),
                2,
            ),
            (
                format!("solid x endsolid x\nsolid y\n{FACET}endsolid y\nsolid z endsolid"),
                1,
            ),
            (
                format!("solid a facet of normal size\n{FACET}endsolid a solid facet"),
                1,
            ),
            (
                format!("solid M\u{fc}ller\r\n{FACET}endsolid").replace("endloop\n", "endloop\r"),
                1,
            ),
            (format!("solid\n{FACET}\rendsolid").replace('\n', "\r"), 1),
            (format!("\n\t solid x\n{FACET}endsolid x\n\0\0\0"), 1),
        ] {
            let mesh = read(text.as_bytes()).unwrap();
            assert_eq!(mesh.triangles.len(), count, "{text:?}");
            assert_eq!(mesh.vertices.len(), 3, "{text:?}");
        }
    }

    #[test]
    fn ascii_errors_name_the_line() {
        for (from, to, at) in [
            ("vertex 1 0 -0.0", "vertex 1 0", 5),
            ("vertex 1 0 -0.0", "vertex 1 0 z", 5),
            ("vertex 1 0 -0.0", "vertex 1 0 0 0", 5),
            ("vertex 1 0 -0.0", "vertex 1 0 0 5,0", 5),
            ("vertex 1 0 -0.0", "vertex 1 0 0\nvertex 1 0 0", 7),
            ("vertex 0 0 0\n", "", 6),
            ("outer loop", "inner loop", 3),
            ("outer loop", "outer", 4),
            ("outer loop\n", "", 3),
            ("normal nan nan nan", "nan nan nan", 2),
            ("normal nan nan nan", "normal nan nan", 3),
            ("normal nan nan nan", "normal nan nan nan nan", 2),
            ("facet normal nan nan nan\nouter loop\n", "", 2),
            ("endloop\n", "", 7),
            ("endfacet\n", "", 8),
            ("endfacet\n", "endfacet\nendfacet\n", 9),
            ("endsolid x\n", "", 8),
            ("endsolid x\n", "endsolid x facet normal 0 0 1\n", 9),
            ("endsolid x\n", "endsolid x\nmore", 10),
            ("endloop\nendfacet\nendsolid x\n", "", 6),
            ("vertex 1 0 -0.0", "vertex 1 0 nan", 5),
            ("vertex 1 0 -0.0", "vertex 1 0 1e30", 5),
        ] {
            let text = format!("solid x\n{FACET}endsolid x\n").replacen(from, to, 1);
            match read(text.as_bytes()) {
                Err(IoError {
                    place: Some(Place::Line(line)),
                    ..
                }) => assert_eq!(line, at, "{to}"),
                other => panic!("{to}: {other:?}"),
            }
        }
    }
}
