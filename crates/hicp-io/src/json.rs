//! Reading and writing of JSON files. Every error names the path of keys to the value.

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::marker::PhantomData;
use std::path::Path;

use serde::Deserialize;
use serde::de::{DeserializeOwned, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::Value;
use serde_json::error::Category;

use crate::atomic::write_atomically;
use crate::error::{IoError, Place, quote};
use crate::limits::{Limit, ReadLimits};
use crate::source::text_bytes;

/// The largest number of characters of a key path that a message shows.
const SHOWN: usize = 200;

/// Reads a JSON file.
///
/// Numbers keep every digit of an `f64`. Keys that the type does not have are ignored.
pub(crate) fn read<T: DeserializeOwned>(
    limits: &ReadLimits,
    path: &Path,
    limit: Limit,
) -> Result<T, IoError> {
    let content = limits.read(path, limit)?;
    parse(path, text_bytes(path, &content)?)
}

/// Parses the text of a JSON file.
pub(crate) fn parse<T: DeserializeOwned>(path: &Path, text: &[u8]) -> Result<T, IoError> {
    let mut json = serde_json::Deserializer::from_slice(text);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let key = error.path().to_string();
        let root = match key.as_str() {
            "." => return refusal(path, text, "$".to_owned(), error.into_inner()),
            key if key.starts_with('[') => "$",
            _ => "$.",
        };
        let key = key.escape_debug().take(SHOWN);
        let key = root.chars().chain(key).collect();
        refusal(path, text, key, error.into_inner())
    })?;
    match json.end() {
        Ok(()) => Ok(value),
        Err(error) => Err(refusal(path, text, String::new(), error)),
    }
}

fn refusal(path: &Path, text: &[u8], key: String, error: serde_json::Error) -> IoError {
    if error.classify() != Category::Data {
        let place = Place::Field(format!("line {}, column {}", error.line(), error.column()));
        let line = text
            .split(|byte| *byte == b'\n')
            .nth(error.line().saturating_sub(1));
        let rest = line.and_then(|line| line.get(error.column().saturating_sub(1)..));
        // Python writes them.
        let special = ["NaN", "Infinity"].into_iter();
        let mut special = special.filter(|word| rest.unwrap_or(b"").starts_with(word.as_bytes()));
        return match special.next() {
            Some(word) => IoError::new(path, place, word, "a number; JSON has null for none"),
            None => IoError::new(path, place, "text that is not valid JSON", "JSON"),
        }
        .with_source(error);
    }
    let text = error.to_string();
    let text = text
        .rsplit_once(" at line ")
        .map_or(&*text, |(text, _)| text);
    let (found, expected) = match text.split_once(", expected ") {
        Some((found, expected)) => (plain(found), expected.to_owned()),
        None => match text.split_once(" field ") {
            Some(("missing", key)) => (
                format!("no key {key}"),
                format!("an object with the key {key}"),
            ),
            Some(("duplicate", key)) => (
                format!("the key {key} twice in one object"),
                "it once".to_owned(),
            ),
            _ => (text.to_owned(), "a usable value".to_owned()),
        },
    };
    let expected = match &*expected {
        "f64" => "a number",
        "u32" => "an integer from 0 to 4294967295",
        "a sequence" => "an array",
        "a map" => "an object",
        other => other,
    };
    IoError::new(path, Place::Field(key), found, expected)
}

/// Rewrites serde's description of a found value in the terms of JSON, shortened.
fn plain(found: &str) -> String {
    if let Some(length) = found.strip_prefix("invalid length ") {
        return format!("an array of {length}");
    }
    let found = ["invalid type: ", "invalid value: "]
        .iter()
        .find_map(|prefix| found.strip_prefix(prefix))
        .unwrap_or(found);
    match found.split_once(' ') {
        Some(("string", text)) => format!("the text {}", quote(text.trim_matches('"'))),
        _ => match found {
            "sequence" => "an array".to_owned(),
            "map" => "an object".to_owned(),
            _ => match found.split('`').nth(1) {
                Some(number) if found.ends_with('`') => number.to_owned(),
                _ => found.to_owned(),
            },
        },
    }
}

/// An array of N numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Numbers<const N: usize>(pub(crate) [f64; N]);

impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Items<const N: usize>;
        impl<'de, const N: usize> Visitor<'de> for Items<N> {
            type Value = Numbers<N>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "an array of {N} numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Self::Value, A::Error> {
                let mut numbers = Vec::new();
                while let Some(number) = items.next_element()? {
                    numbers.push(number);
                }
                let count = numbers.len();
                let numbers = numbers.try_into().map(Numbers);
                numbers.map_err(|_| A::Error::invalid_length(count, &self))
            }
        }
        deserializer.deserialize_seq(Items)
    }
}

/// Reads an optional array of N numbers.
pub(crate) fn optional_numbers<'de, D: Deserializer<'de>, const N: usize>(
    deserializer: D,
) -> Result<Option<[f64; N]>, D::Error> {
    Ok(Option::deserialize(deserializer)?.map(|Numbers(numbers)| numbers))
}

/// A number above 0.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "f64")]
pub(crate) struct Positive(pub(crate) f64);

impl TryFrom<f64> for Positive {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, String> {
        match value {
            value if value > 0.0 => Ok(Self(value)),
            _ => Err(format!("{value}, expected a number above 0, in mm")),
        }
    }
}

/// The members of an object whose keys are numbers, as in BOP's files.
#[derive(Debug)]
pub(crate) struct ById<T>(pub(crate) BTreeMap<u32, T>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for ById<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Members<T> {
            type Value = ById<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object whose keys are numbers")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<ById<T>, A::Error> {
                let mut entries = BTreeMap::new();
                while let Some(key) = members.next_key::<String>()? {
                    let id: u32 = key.parse().map_err(|_| {
                        A::Error::custom(format!(
                            "the key {}, expected keys that are numbers",
                            quote(&key)
                        ))
                    })?;
                    if entries.insert(id, members.next_value()?).is_some() {
                        return Err(A::Error::custom(format!(
                            "the number {id} twice, expected each number once"
                        )));
                    }
                }
                Ok(ById(entries))
            }
        }
        deserializer.deserialize_map(Members(PhantomData))
    }
}

/// Writes a JSON value, on one line or indented.
///
/// Refuses a value that contains `null`, because `serde_json` stores it for a number that is not
/// finite.
pub(crate) fn write(path: &Path, value: &Value, indented: bool) -> Result<(), IoError> {
    write_atomically(path, |file| {
        if let Some(key) = null_in(value) {
            return Err(not_finite(&format!("${key}")));
        }
        match indented {
            true => writeln!(file, "{value:#}"),
            false => writeln!(file, "{value}"),
        }
    })
}

/// Returns the path of keys to the first `null`.
fn null_in(value: &Value) -> Option<String> {
    match value {
        Value::Null => Some(String::new()),
        Value::Array(items) => (items.iter().enumerate())
            .find_map(|(index, item)| Some(format!("[{index}]{}", null_in(item)?))),
        Value::Object(members) => {
            (members.iter()).find_map(|(name, member)| Some(format!(".{name}{}", null_in(member)?)))
        }
        _ => None,
    }
}

/// Returns the error for a number that is not finite, which no file can hold.
pub(crate) fn not_finite(place: &str) -> io::Error {
    let text = format!("{place} is not a finite number, expected one");
    io::Error::new(io::ErrorKind::InvalidInput, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document<T: DeserializeOwned>(text: &str) -> Result<T, IoError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        std::fs::write(&path, text).unwrap();
        read(&ReadLimits::DEFAULT, &path, Limit::JSON_BYTES)
    }

    #[test]
    fn syntax_errors_name_line_and_column() {
        for text in ["", "{\n", "[1,]", "1e999", "1 2"] {
            let error = document::<Value>(text).unwrap_err();
            assert!(error.found.contains("not valid JSON"), "{text}: {error}");
        }
        let error = document::<Numbers<2>>("[1, Infinity]").unwrap_err();
        assert_eq!(error.found, "Infinity");
        let error = document::<Value>("{\n \"a\": NaN}").unwrap_err();
        assert_eq!(
            error.place,
            Some(Place::Field("line 2, column 7".to_owned()))
        );
    }

    #[derive(Debug, Deserialize)]
    #[serde(expecting = "an object with an item")]
    struct Item {
        #[serde(rename = "R")]
        r: Numbers<3>,
        n: u32,
        t: Option<Positive>,
    }

    #[test]
    fn duplicate_keys_are_refused() {
        let twice = "[{\"n\": 1, \"R\": [1, 2, 3]},\n{\"n\": 1, \"n\": 1}]";
        let error = document::<Vec<Item>>(twice).unwrap_err().to_string();
        let expected = "$[1]: found the key `n` twice in one object, expected it once";
        assert!(error.ends_with(expected), "{error}");
        let twice = "{\"2\": 1, \"1\": 0, \"000002\": 3}";
        let error = document::<ById<u32>>(twice).unwrap_err().to_string();
        assert!(error.contains("the number 2 twice"), "{error}");
    }

    #[test]
    fn errors_name_the_key_the_value_and_the_expectation() {
        let long = "x".repeat(500);
        for (item, message) in [
            (
                "{\"n\": 1, \"R\": [1, \"x\", 3]}",
                "$.7[0].R[1]: found the text \"x\", expected a number",
            ),
            (
                "{\"n\": 1, \"R\": [1, 2]}",
                "$.7[0].R: found an array of 2, expected an array of 3 numbers",
            ),
            (
                "{\"n\": 1, \"R\": 4}",
                "$.7[0].R: found 4, expected an array of 3 numbers",
            ),
            (
                "{\"n\": -1}",
                "$.7[0].n: found -1, expected an integer from 0 to 4294967295",
            ),
            (
                "{\"n\": null}",
                "$.7[0].n: found null, expected an integer from 0 to 4294967295",
            ),
            (
                "{\"n\": 1}",
                "$.7[0]: found no key `R`, expected an object with the key `R`",
            ),
            (
                "{\"t\": 0}",
                "$.7[0].t: found 0, expected a number above 0, in mm",
            ),
            ("3", "$.7[0]: found 3, expected an object with an item"),
            (
                "{\"n\": NaN}",
                ": found NaN, expected a number; JSON has null for none",
            ),
            (
                &format!("{{\"n\": \"{long}\"}}"),
                &format!("the text \"{}\"..., expected", &long[..60]),
            ),
        ] {
            let text = format!("\u{feff}{{\"7\": [{item}]}}");
            let error = document::<ById<Vec<Item>>>(&text).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
        let ById(items) = document::<ById<Item>>("{\"1\": {\"R\": [1, 2, 3], \"n\": 5}}").unwrap();
        assert_eq!((items[&1].r, items[&1].n), (Numbers([1.0, 2.0, 3.0]), 5));
        assert!(items[&1].t.is_none());
        let error = document::<ById<u32>>("{\"x\": 1}").unwrap_err();
        assert_eq!(error.expected, "keys that are numbers");
        let error = document::<ById<u32>>("[1]").unwrap_err().to_string();
        assert!(
            error.ends_with("$: found an array, expected an object whose keys are numbers"),
            "{error}"
        );
    }
}
