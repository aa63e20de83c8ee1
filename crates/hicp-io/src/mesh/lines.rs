//! Lines of text files with any line endings.

use std::str::FromStr;

use super::raw::Reading;
use crate::error::{END_OF_FILE, IoError, Place, quote};

/// The lines of a text without their line endings.
///
/// A line ends with a line feed, a carriage return, or both in this order. All three may occur in
/// one file, because several programs may have written to it.
#[derive(Clone, Debug)]
pub(super) struct Lines<'a> {
    rest: &'a str,
    taken: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self::after(0, text)
    }

    /// Creates the lines of a text that follows `taken` other lines of its file.
    pub(super) fn after(taken: usize, rest: &'a str) -> Self {
        Self { rest, taken }
    }

    /// Returns the place of the last line read.
    pub(super) fn place(&self) -> Place {
        Place::Line(self.taken.max(1))
    }

    /// Returns the number of bytes that are not read yet.
    pub(super) fn left(&self) -> u64 {
        self.rest.len() as u64
    }

    /// Returns the next line that is not blank, without its comment; empty at the end of the text.
    pub(super) fn record(&mut self) -> &'a str {
        let mut lines = self.map(without_comment);
        lines.find(|line| !line.is_empty()).unwrap_or_default()
    }

    /// Returns the error for the last line read, or for the end of the file if `line` is empty.
    pub(super) fn refuse(&self, reading: &Reading<'_>, line: &str, expected: String) -> IoError {
        let found = match line {
            "" => END_OF_FILE.to_owned(),
            line => quote(line),
        };
        reading.refuse(self.place(), found, expected)
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        if self.rest.is_empty() {
            return None;
        }
        self.taken += 1;
        let end = self.rest.find(['\n', '\r']).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        let ends = ["\r\n", "\n", "\r"].into_iter();
        self.rest = ends
            .filter_map(|end| rest.strip_prefix(end))
            .next()
            .unwrap_or_default();
        Some(line)
    }
}

/// Returns the numbers at the start of a text, up to the first word that is not one.
pub(super) fn numbers<T: FromStr>(text: &str) -> impl Iterator<Item = T> {
    let words = text.split_whitespace();
    words.map_while(|word| word.parse().ok())
}

/// Removes the comment of a line and the surrounding spaces.
pub(super) fn without_comment(line: &str) -> &str {
    line.split('#').next().unwrap_or_default().trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_may_have_a_different_ending() {
        for (text, lines) in [
            ("", &[][..]),
            ("a", &["a"]),
            ("a\nb\r\nc\rd", &["a", "b", "c", "d"]),
            ("a\n\nb\r\r\n\r\n", &["a", "", "b", "", ""]),
            ("\n\r", &["", ""]),
        ] {
            let found: Vec<_> = Lines::new(text).collect();
            assert_eq!(found, lines, "{text:?}");
        }
    }
}
