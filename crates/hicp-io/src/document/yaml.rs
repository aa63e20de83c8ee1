//! YAML, as ROS and OpenCV write it.

use std::path::Path;

use saphyr_parser::{Event, Parser, ScalarStyle};
use serde_json::{Map, Value};

use super::scalar::{DEEPEST, scalar};
use crate::error::{IoError, Place, quote};

/// Parses the first document of a YAML file. References are refused, since they can multiply.
pub(super) fn parse(path: &Path, text: &str) -> Result<Value, IoError> {
    // OpenCV writes the directive with a colon, which is not valid.
    let (skipped, text) = match text.split_once('\n') {
        Some((first, rest)) if first.starts_with("%YAML") => (1, rest),
        _ => (0, text),
    };
    // The open arrays and objects, each with the key of the next member.
    let mut open: Vec<(Value, Option<String>)> = Vec::new();
    for event in Parser::new_from_str(text) {
        let refuse = |line: usize, found: &str, expected: &str| {
            IoError::new(path, Place::Line(line + skipped), found, expected)
        };
        let (event, span) = event.map_err(|error| {
            let found = format!("text that is not valid YAML: {}", quote(error.info()));
            refuse(
                error.marker().line(),
                &found,
                "YAML, or lines of numbers only",
            )
        })?;
        let line = span.start.line();
        let value = match event {
            Event::SequenceStart(..) | Event::MappingStart(..) if open.len() >= DEEPEST => {
                return Err(refuse(line, "deeply nested values", "at most 127 levels"));
            }
            Event::SequenceStart(..) => {
                open.push((Value::Array(Vec::new()), None));
                continue;
            }
            Event::MappingStart(..) => {
                open.push((Value::Object(Map::new()), None));
                continue;
            }
            Event::Scalar(text, ScalarStyle::Plain, ..) => scalar(&text),
            Event::Scalar(text, ..) => Value::from(&*text),
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some((value, _)) => value,
                None => continue,
            },
            Event::Alias(_) => return Err(refuse(line, "a YAML reference", "the value itself")),
            _ => continue,
        };
        match open.last_mut() {
            None => return Ok(value),
            Some((Value::Array(items), _)) => items.push(value),
            Some((Value::Object(members), key)) => match key.take() {
                Some(name) => {
                    if members.insert(name.clone(), value).is_some() {
                        let found = format!("the key {} twice", quote(&name));
                        return Err(refuse(line, &found, "it once"));
                    }
                }
                None => {
                    let text = value.as_str().map(str::to_owned);
                    *key = Some(text.unwrap_or_else(|| value.to_string()));
                }
            },
            Some(_) => {}
        }
    }
    Err(IoError::new(path, None, "no YAML document", "one"))
}
