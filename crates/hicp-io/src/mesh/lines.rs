//! Lines of text files, whatever ends each of them.

/// The lines of a text, without what ends them: a line feed, a carriage return, or both in this order.
///
/// Files that several programs have written to mix them.
#[derive(Clone, Debug)]
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    taken: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self::after(0, text)
    }

    /// The lines of a text that follows so many other lines of its file.
    pub(super) fn after(taken: usize, rest: &'a [u8]) -> Self {
        Self { rest, taken }
    }

    /// Returns the number of the last line taken, from 1.
    pub(super) fn number(&self) -> usize {
        self.taken.max(1)
    }

    /// Returns the bytes that are left.
    pub(super) fn left(&self) -> u64 {
        self.rest.len() as u64
    }

    /// Returns the next line that is not blank, without what follows a `#`.
    pub(super) fn next_without_comment(&mut self) -> Option<String> {
        self.find_map(|line| {
            let line = String::from_utf8_lossy(line);
            let line = line.split('#').next().unwrap_or_default().trim();
            (!line.is_empty()).then(|| line.to_owned())
        })
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.taken += 1;
        let ends = |byte: &u8| matches!(byte, b'\n' | b'\r');
        let end = self.rest.iter().position(ends).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = match rest {
            [b'\r', b'\n', rest @ ..] | [_, rest @ ..] => rest,
            [] => rest,
        };
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_has_its_own_end() {
        for (text, lines) in [
            ("", &[][..]),
            ("a", &["a"]),
            ("a\nb\r\nc\rd", &["a", "b", "c", "d"]),
            ("a\n\nb\r\r\n\r\n", &["a", "", "b", "", ""]),
            ("\n\r", &["", ""]),
        ] {
            let found: Vec<_> = Lines::new(text.as_bytes()).collect();
            let wanted: Vec<_> = lines.iter().map(|line| line.as_bytes()).collect();
            assert_eq!(found, wanted, "{text:?}");
        }
    }
}
