//! JSON values that know their file and their path of keys, so that every refusal can name both.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

use crate::error::{IoError, quote};
use crate::limits::ReadLimits;
use crate::source::{Limited, Source, text_bytes};

/// A parsed JSON file.
#[derive(Debug)]
pub(crate) struct Document {
    path: PathBuf,
    value: Value,
}

impl Document {
    /// Reads a JSON file whole, within limits. Numbers keep every digit of an `f64`.
    pub(crate) fn read(limits: &ReadLimits, path: &Path) -> Result<Self, IoError> {
        Self::parse(path, Limited::JsonBytes, limits.max_json_bytes)
    }

    /// Reads a JSON file that states one thing.
    pub(crate) fn read_small(limits: &ReadLimits, path: &Path) -> Result<Self, IoError> {
        Self::parse(path, Limited::SmallJsonBytes, limits.max_small_json_bytes)
    }

    fn parse(path: &Path, what: Limited, limit: u64) -> Result<Self, IoError> {
        let content = Source::open(path)?.read(what, limit)?;
        let parsed = serde_json::from_slice::<Unambiguous>(text_bytes(path, &content)?);
        let Unambiguous(value) = parsed.map_err(|error| IoError::JsonSyntax {
            path: path.to_owned(),
            line: error.line(),
            column: error.column(),
            source: error.into(),
        })?;
        Ok(Self {
            path: path.to_owned(),
            value,
        })
    }

    pub(crate) fn root(&self) -> Node<'_> {
        Node {
            path: &self.path,
            key: "$".to_owned(),
            value: &self.value,
        }
    }
}

/// A value in which no object has a key twice, of which one would be lost.
struct Unambiguous(Value);

impl<'de> Deserialize<'de> for Unambiguous {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ValueVisitor).map(Self)
    }
}

struct ValueVisitor;

impl<'de> Visitor<'de> for ValueVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_string<E>(self, value: String) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(Unambiguous(value)) = items.next_element()? {
            values.push(value);
        }
        Ok(values.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = members.next_key::<String>()? {
            if object.contains_key(&key) {
                let key = quote(&key);
                return Err(A::Error::custom(format!(
                    "the key {key} twice in one object, expected it once"
                )));
            }
            let Unambiguous(value) = members.next_value()?;
            object.insert(key, value);
        }
        Ok(object.into())
    }
}

/// A value of a document.
#[derive(Clone, Debug)]
pub(crate) struct Node<'a> {
    path: &'a Path,
    key: String,
    value: &'a Value,
}

impl<'a> Node<'a> {
    pub(crate) fn path(&self) -> &'a Path {
        self.path
    }

    pub(crate) fn key(&self) -> &str {
        &self.key
    }

    /// Returns the member `name` of an object, or `None` when it is not there or `null`.
    pub(crate) fn optional(&self, name: &str) -> Option<Self> {
        let value = self.value.get(name).filter(|value| !value.is_null())?;
        Some(Self {
            path: self.path,
            key: format!("{}.{name}", self.key),
            value,
        })
    }

    pub(crate) fn get(&self, name: &str) -> Result<Self, IoError> {
        self.optional(name).ok_or_else(|| {
            let expected = format!("an object with the key `{name}`");
            match self.value.get(name) {
                Some(_) => self.refuse_found(format!("`{name}` that is null"), expected),
                None => self.refuse(expected),
            }
        })
    }

    /// Returns the members of an object whose keys are numbers, as BOP's are, in ascending order.
    pub(crate) fn numbered(&self) -> Result<Vec<(u32, Self)>, IoError> {
        let members = self
            .value
            .as_object()
            .ok_or_else(|| self.refuse("an object whose keys are numbers"))?;
        let mut numbered = Vec::with_capacity(members.len());
        for (name, value) in members {
            let number = name
                .parse()
                .map_err(|_| self.refuse_found(quote(name), "keys that are numbers"))?;
            let key = format!("{}.{name}", self.key);
            let path = self.path;
            numbered.push((number, Self { path, key, value }));
        }
        numbered.sort_by_key(|(number, _)| *number);
        match numbered.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            Some([(number, _), (_, second)]) => Err(second.refuse_found(
                format!("the number {number} a second time"),
                "each number once",
            )),
            _ => Ok(numbered),
        }
    }

    pub(crate) fn items(&self) -> Result<Vec<Self>, IoError> {
        let items = self
            .value
            .as_array()
            .ok_or_else(|| self.refuse("an array"))?;
        Ok(items
            .iter()
            .enumerate()
            .map(|(index, value)| Self {
                path: self.path,
                key: format!("{}[{index}]", self.key),
                value,
            })
            .collect())
    }

    pub(crate) fn number(&self) -> Result<f64, IoError> {
        self.value.as_f64().ok_or_else(|| self.refuse("a number"))
    }

    pub(crate) fn text(&self) -> Option<&'a str> {
        self.value.as_str()
    }

    pub(crate) fn unsigned(&self) -> Result<u32, IoError> {
        self.value
            .as_u64()
            .and_then(|value| u32::try_from(value).ok())
            .ok_or_else(|| self.refuse("an integer from 0 to 4294967295"))
    }

    pub(crate) fn numbers<const N: usize>(&self) -> Result<[f64; N], IoError> {
        let items = match self.value.as_array() {
            Some(items) if items.len() == N => items,
            _ => return Err(self.refuse(format!("an array of {N} numbers"))),
        };
        let mut numbers = [0.0; N];
        for (index, (number, item)) in numbers.iter_mut().zip(items).enumerate() {
            *number = item.as_f64().ok_or_else(|| IoError::JsonValue {
                path: self.path.to_owned(),
                key: format!("{}[{index}]", self.key),
                found: describe(item),
                expected: format!("a number, one of {N}"),
            })?;
        }
        Ok(numbers)
    }

    /// Makes the error for a value that is not what was expected.
    pub(crate) fn refuse(&self, expected: impl Into<String>) -> IoError {
        self.refuse_found(describe(self.value), expected)
    }

    pub(crate) fn refuse_found(&self, found: String, expected: impl Into<String>) -> IoError {
        IoError::JsonValue {
            path: self.path.to_owned(),
            key: self.key.clone(),
            found,
            expected: expected.into(),
        }
    }
}

/// Refuses to write a value of ours in which something is `null`: it was not a finite number.
pub(crate) fn check_finite(value: &Value) -> io::Result<()> {
    fn find(value: &Value, key: &mut String) -> bool {
        let length = key.len();
        let mut inside = |name: String, value| {
            key.truncate(length);
            key.push_str(&name);
            find(value, key)
        };
        match value {
            Value::Null => true,
            Value::Array(items) => {
                let mut items = items.iter().enumerate();
                items.any(|(index, item)| inside(format!("[{index}]"), item))
            }
            Value::Object(members) => {
                let mut members = members.iter();
                members.any(|(name, member)| inside(format!(".{name}"), member))
            }
            _ => false,
        }
    }
    let mut key = "$".to_owned();
    if find(value, &mut key) {
        return Err(not_finite(&key));
    }
    Ok(())
}

/// The error for a number that no file can state.
pub(crate) fn not_finite(place: &str) -> io::Error {
    let text = format!("{place} is not a finite number, expected one");
    io::Error::new(io::ErrorKind::InvalidInput, text)
}

fn describe(value: &Value) -> String {
    match value {
        Value::Null => "null".to_owned(),
        Value::Bool(value) => value.to_string(),
        Value::Number(number) => number.to_string(),
        Value::String(text) => format!("the text {}", quote(text)),
        Value::Array(items) => format!("an array of {}", items.len()),
        Value::Object(members) if members.is_empty() => "an empty object".to_owned(),
        Value::Object(members) => {
            let mut names: Vec<String> = members.keys().take(12).map(|key| quote(key)).collect();
            if members.len() > names.len() {
                names.push("...".to_owned());
            }
            let names = names.join(", ");
            let shown: String = names.chars().take(200).collect();
            let rest = if shown.len() < names.len() { "..." } else { "" };
            format!("an object with the keys {shown}{rest}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(text: &str) -> Result<Document, IoError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        std::fs::write(&path, text).unwrap();
        Document::read(&ReadLimits::DEFAULT, &path)
    }

    #[test]
    fn syntax_errors_name_line_and_column() {
        for text in ["{\n \"a\": NaN}", "", "{\n", "[1,]", "1e999"] {
            assert!(
                matches!(document(text), Err(IoError::JsonSyntax { .. })),
                "{text}"
            );
        }
        match document("{\n \"a\": NaN}") {
            Err(IoError::JsonSyntax { line, .. }) => assert_eq!(line, 2),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_is_there_twice_is_not_lost() {
        for (text, at) in [
            ("{\"a\": 1,\n \"a\": 2}", 2),
            ("[\n{\"b\": {\"c\": 1}},\n{\"b\": {\"c\": 1, \"c\": 1}}]", 3),
        ] {
            match document(text) {
                Err(IoError::JsonSyntax { line, source, .. }) => {
                    assert_eq!(line, at);
                    assert!(
                        source.to_string().contains("twice in one object"),
                        "{source}"
                    );
                }
                other => panic!("{other:?}"),
            }
        }
        let numbers = document("{\"2\": 1, \"1\": 0, \"000002\": 3}").unwrap();
        let error = numbers.root().numbered().unwrap_err().to_string();
        assert!(error.contains("the number 2 a second time"), "{error}");
        let all = document("{\"a\": [null, true, -1, 18446744073709551615, 0.1, \"\\u00e9\", {}]}");
        let text = all.unwrap().value.to_string();
        assert_eq!(
            text,
            "{\"a\":[null,true,-1,18446744073709551615,0.1,\"é\",{}]}"
        );
    }

    #[test]
    fn refusals_name_the_key_the_value_and_what_was_expected() {
        let document =
            document("\u{feff}{\"a\": [{\"R\": [1, \"x\", 3], \"n\": -1, \"t\": 4}]}").unwrap();
        let item = document.root().get("a").unwrap().items().unwrap().remove(0);
        let message = |result: Result<(), IoError>| {
            let text = result.unwrap_err().to_string();
            text.split_once(", ").unwrap().1.to_owned()
        };
        let r = item.get("R").unwrap();
        assert_eq!(
            message(r.numbers::<3>().map(|_| ())),
            "$.a[0].R[1]: found the text \"x\", expected a number, one of 3"
        );
        assert_eq!(
            message(r.numbers::<9>().map(|_| ())),
            "$.a[0].R: found an array of 3, expected an array of 9 numbers"
        );
        assert_eq!(
            message(item.get("n").unwrap().unsigned().map(|_| ())),
            "$.a[0].n: found -1, expected an integer from 0 to 4294967295"
        );
        assert_eq!(
            message(item.get("t").unwrap().numbers::<3>().map(|_| ())),
            "$.a[0].t: found 4, expected an array of 3 numbers"
        );
        assert!(
            message(item.get("z").map(|_| ())).ends_with("expected an object with the key `z`")
        );
        assert!(document.root().numbered().is_err());
        assert_eq!(describe(&serde_json::json!({})), "an empty object");
        assert_eq!(
            describe(&serde_json::json!({"a": 1, "b": 2})),
            "an object with the keys \"a\", \"b\""
        );
    }
}
