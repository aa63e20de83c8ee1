//! STL, ASCII and binary.
//!
//! Read here because readers at hand stop at the first `endsolid`, refuse `solid` without a name and facet normals that are
//! not finite, take binary files for text by the first word of their header, and do not say where a file is broken; all of
//! these occur in files that people have. Normals are not read: the winding says the same.

use std::path::Path;

use hicp_core::Point3;

use super::lines::Lines;
use super::weld::Welder;
use super::{RawMesh, Reading};
use crate::error::{END_OF_FILE, IoError, Place};
use crate::source::text_bytes;

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;
/// Where a binary file says how many triangles it has.
const COUNT: Place = Place::Byte(80);

/// Refuses a binary file by its header, when it has the triangles that it promises and they are too many.
pub(super) fn check_head(reading: &Reading<'_>, head: &[u8], bytes: u64) -> Result<(), IoError> {
    match triangle_count(head) {
        Some(count) if fits(binary_bytes(count), bytes) => {
            reading.check_triangles(COUNT, count as usize)
        }
        _ => Ok(()),
    }
}

/// Parses an STL file; vertices at the same position become one.
pub(super) fn parse(reading: &Reading<'_>, content: Vec<u8>) -> Result<RawMesh, IoError> {
    // By size first: any 80 bytes may begin a binary file, `solid` and what looks like UTF-16 among them.
    let is_binary = triangle_count(&content)
        .is_some_and(|count| fits(binary_bytes(count), content.len() as u64));
    if is_binary {
        return parse_binary(reading, &content);
    }
    let text = text_bytes(reading.path, &content)?;
    // Some programs fill the last block of a text with zeros. A binary header that has lost its triangles ends in some, too.
    let filling = text.iter().rev().take_while(|byte| **byte == 0).count();
    let text = match &text[..text.len() - filling] {
        filled if filled.len() > HEADER_BYTES => filled,
        _ => text,
    };
    if is_text(text) {
        parse_ascii(reading, text)
    } else {
        parse_binary(reading, &content)
    }
}

/// Tells text from a binary file that has lost its end: its count holds a 0 or another byte that no text does.
fn is_text(content: &[u8]) -> bool {
    let start = &content[..content.len().min(512)];
    let solid = start.trim_ascii_start().get(..5);
    let is_solid = solid.is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let breaks = |byte: &u8| byte.is_ascii_control() && !byte.is_ascii_whitespace();
    !start.is_empty() && !start.contains(&0) && (is_solid || !start.iter().any(breaks))
}

fn triangle_count(content: &[u8]) -> Option<u32> {
    let bytes = content.get(HEADER_BYTES - 4..HEADER_BYTES)?;
    Some(u32::from_le_bytes(bytes.try_into().ok()?))
}

fn binary_bytes(count: u32) -> u64 {
    HEADER_BYTES as u64 + u64::from(count) * TRIANGLE_BYTES as u64
}

/// Says whether a file has the bytes that a binary one takes: a few bytes of padding are harmless, another triangle is not.
fn fits(needed: u64, bytes: u64) -> bool {
    (needed..needed + TRIANGLE_BYTES as u64).contains(&bytes)
}

fn parse_binary(reading: &Reading<'_>, content: &[u8]) -> Result<RawMesh, IoError> {
    let end = Place::Byte(content.len() as u64);
    let Some(count) = triangle_count(content) else {
        return Err(IoError::at(
            reading.path,
            end,
            END_OF_FILE,
            "`solid`, or a binary header of 84 bytes",
        ));
    };
    let body = &content[HEADER_BYTES..];
    let needed = u64::from(count) * TRIANGLE_BYTES as u64;
    if needed > body.len() as u64 {
        return Err(IoError::Promise {
            path: reading.path.to_owned(),
            place: COUNT,
            what: "triangles".to_owned(),
            count: u64::from(count),
            needed,
            available: body.len() as u64,
        });
    }
    let there = body.len() / TRIANGLE_BYTES;
    if there > count as usize {
        return Err(IoError::at(
            reading.path,
            COUNT,
            &format!("a count of {count} triangles"),
            format!("{there}, which the file has bytes for"),
        ));
    }
    reading.check_triangles(COUNT, there)?;
    let mut mesh = RawMesh::new(COUNT);
    mesh.found = format!("a count of {count} triangles");
    mesh.triangles.reserve_exact(there);
    let mut welder = Welder::default();
    for (number, triangle) in body.chunks_exact(TRIANGLE_BYTES).enumerate() {
        let start = HEADER_BYTES + number * TRIANGLE_BYTES;
        let mut corners = [0; 3];
        // The normal comes first.
        for (corner, index) in corners.iter_mut().enumerate() {
            let at = 12 * (corner + 1);
            let mut position = [0.0; 3];
            for (value, bytes) in position.iter_mut().zip(triangle[at..].chunks_exact(4)) {
                *value = f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
            }
            let place = Place::Byte((start + at) as u64);
            reading.check_position(place, &position)?;
            *index = welder.index(position, &mut mesh.vertices);
            reading.check_vertices(place, mesh.vertices.len())?;
        }
        mesh.triangles.push(corners);
    }
    Ok(mesh)
}

fn parse_ascii(reading: &Reading<'_>, content: &[u8]) -> Result<RawMesh, IoError> {
    let path = reading.path;
    let mut words = Words::new(content);
    let mut mesh = RawMesh::new(Place::Line(1));
    let mut welder = Welder::default();
    words.expect(path, "solid", "`solid`, or a binary header of 84 bytes")?;
    words.skip_name();
    // Without its last line a file may have lost any number of facets.
    let mut open = true;
    while let Some(word) = words.next() {
        if word.is("facet") {
            open = true;
            let corners = parse_facet(reading, &mut words, &mut mesh.vertices, &mut welder)?;
            mesh.triangles.push(corners);
            reading.check_triangles(Place::Line(word.line), mesh.triangles.len())?;
        } else if word.is("solid") || word.is("endsolid") {
            open = word.is("solid");
            words.skip_name();
        } else {
            return Err(word.error(path, "`facet`, `endsolid` or `solid`"));
        }
    }
    if open {
        return Err(words.ended(path, "`endsolid`"));
    }
    mesh.end = Place::Line(words.line());
    Ok(mesh)
}

/// Reads what follows `facet`.
fn parse_facet(
    reading: &Reading<'_>,
    words: &mut Words<'_>,
    vertices: &mut Vec<Point3<f64>>,
    welder: &mut Welder,
) -> Result<[u32; 3], IoError> {
    let path = reading.path;
    let normal = "`normal` and three components";
    words.expect(path, "normal", normal)?;
    for _ in 0..3 {
        // Some programs write what C prints for a normal without a direction: any word will do, but the next keyword.
        let component = words.next().ok_or_else(|| words.ended(path, normal))?;
        if component.is("outer") {
            return Err(component.error(path, normal));
        }
    }
    words.expect(path, "outer", "`outer loop`")?;
    words.expect(path, "loop", "`outer loop`")?;
    let mut corners = [0; 3];
    for (index, which) in corners.iter_mut().zip(["first", "second", "third"]) {
        let expected = format!("the {which} `vertex` of three and its three numbers");
        let word = words.expect(path, "vertex", &expected)?;
        let mut position = [0.0; 3];
        for value in &mut position {
            let number = words.next().and_then(|word| word.number());
            *value = number.ok_or_else(|| word.error(path, expected.as_str()))?;
        }
        let place = Place::Line(word.line);
        reading.check_position(place, &position)?;
        *index = welder.index(position, vertices);
        reading.check_vertices(place, vertices.len())?;
    }
    words.expect(path, "endloop", "`endloop` after three vertices")?;
    words.expect(path, "endfacet", "`endfacet`")?;
    Ok(corners)
}

/// The words of a text: to this format a line end is a space like any other, but behind a name.
#[derive(Clone, Debug)]
struct Words<'a> {
    lines: Lines<'a>,
    /// Lines taken.
    taken: usize,
    /// What is left of the last of them.
    rest: &'a [u8],
}

impl<'a> Words<'a> {
    fn new(content: &'a [u8]) -> Self {
        Self {
            lines: Lines::new(content),
            taken: 0,
            rest: &[],
        }
    }

    fn next(&mut self) -> Option<Word<'a>> {
        loop {
            if let Some(word) = self.next_of_line() {
                return Some(word);
            }
            self.rest = self.lines.next()?;
            self.taken += 1;
        }
    }

    fn next_of_line(&mut self) -> Option<Word<'a>> {
        let from = self.rest.iter().position(|byte| !is_space(*byte))?;
        let from = &self.rest[from..];
        let end = from.iter().position(|byte| is_space(*byte));
        let (text, rest) = from.split_at(end.unwrap_or(from.len()));
        self.rest = rest;
        Some(Word {
            text,
            from,
            line: self.taken,
        })
    }

    /// Skips the rest of the line, which is a name, up to a facet or `endsolid` that some programs write behind it.
    fn skip_name(&mut self) {
        let mut ahead = self.clone();
        while let Some(word) = ahead.next_of_line() {
            let is_facet = || {
                let next = ahead.clone().next_of_line();
                word.is("facet") && next.is_some_and(|next| next.is("normal"))
            };
            if word.is("endsolid") || is_facet() {
                return;
            }
            *self = ahead.clone();
        }
    }

    fn expect(&mut self, path: &Path, keyword: &str, expected: &str) -> Result<Word<'a>, IoError> {
        match self.next() {
            Some(word) if word.is(keyword) => Ok(word),
            Some(word) => Err(word.error(path, expected)),
            None => Err(self.ended(path, expected)),
        }
    }

    /// The line of the last word.
    fn line(&self) -> usize {
        self.taken.max(1)
    }

    fn ended(&self, path: &Path, expected: &str) -> IoError {
        IoError::line(path, self.line(), END_OF_FILE, expected)
    }
}

#[derive(Clone, Copy, Debug)]
struct Word<'a> {
    text: &'a [u8],
    /// The rest of its line, from it on.
    from: &'a [u8],
    line: usize,
}

impl Word<'_> {
    fn is(&self, keyword: &str) -> bool {
        self.text.eq_ignore_ascii_case(keyword.as_bytes())
    }

    fn number(&self) -> Option<f64> {
        std::str::from_utf8(self.text).ok()?.parse().ok()
    }

    fn error(&self, path: &Path, expected: &str) -> IoError {
        IoError::line(
            path,
            self.line,
            &String::from_utf8_lossy(self.from),
            expected,
        )
    }
}

/// What the C library takes for white space, line ends aside.
fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0b | 0x0c)
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::mesh::tests::reading;

    fn read(content: &[u8]) -> Result<RawMesh, IoError> {
        parse(&reading("a.stl"), content.to_vec())
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
    fn binary_files_by_size_whatever_the_header_says() {
        for title in [&b"solid but binary"[..], b"made by hand"] {
            let mesh = read(&binary(title, 2, 2)).unwrap();
            assert_eq!((mesh.triangles.len(), mesh.vertices.len()), (2, 6));
        }
        let mut trailing = binary(b"x", 1, 1);
        trailing.extend([1, 2, 3]);
        assert_eq!(read(&trailing).unwrap().triangles.len(), 1);
    }

    #[test]
    fn truncated_and_lying_binary_files_are_refused_before_reading() {
        let mut truncated = binary(b"solid", 2, 2);
        truncated.pop();
        for content in [truncated, binary(b"x", u32::MAX, 1), binary(b"solid", 3, 2)] {
            assert!(matches!(read(&content), Err(IoError::Promise { .. })));
        }
        for content in [&b""[..], b"a\x01c", &[0; 83]] {
            assert!(matches!(read(content), Err(IoError::Bytes { .. })));
        }
    }

    #[test]
    fn binary_files_whose_header_looks_like_another_encoding() {
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
            parse(&reading("a.stl"), text.collect()),
            Err(IoError::Encoding { .. })
        ));
    }

    #[test]
    fn a_count_of_0_is_told_where_it_stands() {
        match read(&binary(b"x", 0, 0)).unwrap().finish(&reading("a.stl")) {
            Err(IoError::Bytes {
                offset: 80,
                found,
                expected,
                ..
            }) => {
                assert_eq!(found, "a count of 0 triangles");
                assert_eq!(expected, "a face of three corners or more");
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn text_that_does_not_begin_with_solid_is_told_as_text() {
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
                Err(IoError::Line {
                    line,
                    found,
                    expected,
                    ..
                }) => {
                    assert_eq!((line, found.as_str()), (at, what));
                    assert!(expected.starts_with("`solid`"), "{expected}");
                }
                other => panic!("{text:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn what_the_count_leaves_out_and_what_is_no_position_is_told_by_byte() {
        let mut far = binary(b"x", 2, 2);
        far[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
        for (content, at) in [
            (binary(b"x", 1, 2), 80),
            (binary(b"x", 0, 1), 80),
            (far, 146),
        ] {
            match read(&content) {
                Err(IoError::Bytes { offset, .. }) => assert_eq!(offset, at),
                other => panic!("{other:?}"),
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

    /// Spaces and line ends are the same, but behind a name, and no facet gets lost whichever stand where.
    #[test]
    fn ascii_words_may_stand_on_any_line() {
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
                Err(IoError::Line { line, .. }) => assert_eq!(line, at, "{to}"),
                other => panic!("{to}: {other:?}"),
            }
        }
    }
}
