//! The mutants, as `cargo mutants --list --json` names them.

use std::ops::Range;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::working_copy::{WorkingCopy, output};

/// A change of the code in one place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mutant {
    /// What and where, in words.
    pub(crate) name: String,
    /// Path in the workspace.
    pub(crate) file: String,
    /// What kind of a change: `FnValue`, `BinaryOperator`, …
    pub(crate) genre: String,
    /// The bytes that are replaced.
    pub(crate) range: Range<usize>,
    /// What replaces them.
    pub(crate) replacement: String,
    /// The function that it is in returns an `impl Trait`.
    pub(crate) returns_impl: bool,
    /// What it is known by when lines above it come and go.
    pub(crate) key: Key,
}

/// What a mutant is known by: the change and the line of code, not its number.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(crate) struct Key {
    /// Path in the crate's `src`.
    pub(crate) file: String,
    /// As cargo-mutants words it.
    pub(crate) change: String,
    /// The line, without what it is indented by.
    pub(crate) code: String,
    /// The character of that line at which the change begins, from one.
    pub(crate) column: usize,
}

/// All mutants of the crate.
pub(crate) fn list(copy: &WorkingCopy) -> Result<Vec<Mutant>> {
    copy.restore()?;
    let said =
        output(&mut copy.cargo(&["mutants", "--list", "--json", "--package", &copy.package]))?;
    let listed: Vec<Value> = serde_json::from_str(&said).context("cargo mutants --list --json")?;
    listed
        .iter()
        .map(|value| {
            mutant(value, |file| copy.sources.get(file).map(String::as_str))
                .with_context(|| format!("a mutant that cannot be read: {value}"))
        })
        .collect()
}

fn mutant<'a>(value: &Value, source: impl Fn(&str) -> Option<&'a str>) -> Option<Mutant> {
    let word = |key: &str| value[key].as_str().map(str::to_owned);
    let file = word("file")?;
    let text = source(&file)?;
    let at = |end: &str| {
        let place = &value["span"][end];
        offset(text, place["line"].as_u64()?, place["column"].as_u64()?)
    };
    let (name, range) = (word("name")?, at("start")?..at("end")?);
    let key = key(&name, &file, text, range.start)?;
    Some(Mutant {
        name,
        genre: word("genre")?,
        returns_impl: value["function"]["return_type"]
            .as_str()
            .is_some_and(|returned| returned.contains("impl ")),
        range,
        replacement: word("replacement")?,
        key,
        file,
    })
}

/// A name is `path:line:column: change`.
fn key(name: &str, file: &str, text: &str, start: usize) -> Option<Key> {
    let change = name.strip_prefix(file)?.split_once(": ")?.1;
    let begin = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
    let line = text[begin..].lines().next()?;
    let indent = line.len() - line.trim_start().len();
    Some(Key {
        file: file.split_once("/src/").map_or(file, |(_, f)| f).to_owned(),
        change: change.to_owned(),
        code: line.trim().to_owned(),
        column: text.get(begin + indent..start)?.chars().count() + 1,
    })
}

/// The byte of a line and a column, both from one; columns count characters.
fn offset(text: &str, line: u64, column: u64) -> Option<usize> {
    let mut begin = 0;
    for _ in 1..line {
        begin += text.get(begin..)?.find('\n')? + 1;
    }
    let mut characters = text.get(begin..)?.char_indices();
    let before = usize::try_from(column.checked_sub(1)?).ok()?;
    match characters.nth(before) {
        Some((bytes, _)) => Some(begin + bytes),
        None => Some(text.len()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_characters() {
        let text = "a\nσ = b - c;\n";
        assert_eq!(offset(text, 2, 7), Some(9));
        assert_eq!(&text[9..10], "-");
        assert_eq!(offset(text, 9, 1), None);
    }

    #[test]
    fn a_mutant_is_read() {
        let value = serde_json::json!({
            "file": "c/src/x.rs", "genre": "BinaryOperator", "replacement": "-",
            "name": "c/src/x.rs:2:4: replace + with - in f",
            "span": {"start": {"line": 2, "column": 4}, "end": {"line": 2, "column": 5}},
        });
        let read = mutant(&value, |_| Some("{\n a + b \n}")).unwrap();
        assert_eq!((read.range, read.replacement.as_str()), (5..6, "-"));
        let key = Key {
            file: "x.rs".to_owned(),
            change: "replace + with - in f".to_owned(),
            code: "a + b".to_owned(),
            column: 3,
        };
        assert_eq!(read.key, key);
        assert_eq!(mutant(&value, |_| None), None);
    }
}
