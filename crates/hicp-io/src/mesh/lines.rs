//! Lines of text files, however each of them ends.

/// The lines of a text, without what ends them: a line feed, a carriage return, or both in this order.
///
/// Files that several programs have written to mix them.
#[derive(Clone, Debug)]
pub(super) struct Lines<'a> {
    rest: &'a [u8],
}

impl<'a> Lines<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { rest: text }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
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
