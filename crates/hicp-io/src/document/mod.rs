//! Small files of numbers with names, as one JSON value: JSON, YAML, XML, text, NPY and NPZ.

#[cfg(any(feature = "xml", feature = "yaml"))]
mod scalar;
mod unique;
#[cfg(feature = "xml")]
mod xml;
#[cfg(feature = "yaml")]
mod yaml;

use std::path::Path;

use serde_json::Value;

use self::unique::Unique;
use crate::error::IoError;
use crate::format::{self, Format};
use crate::json;
use crate::limits::{Limit, ReadLimits};
#[cfg(feature = "npy")]
use crate::npy;
use crate::source::text_bytes;

/// The largest count of numbers in an array, more than a matrix has.
#[cfg(feature = "npy")]
const MOST_NUMBERS: usize = 1000;

/// Reads a file by its first bytes.
///
/// Text of numbers only becomes an array with an array for each line. An NPY array becomes a flat
/// array of its numbers, by rows, and an NPZ archive of several arrays an object of such arrays.
/// The flag is `true` if the file is JSON.
pub(crate) fn read(
    limits: &ReadLimits,
    path: &Path,
    expected: &str,
) -> Result<(Value, bool), IoError> {
    let content = limits.read(path, Limit::SMALL_JSON_BYTES)?;
    let format = Format::of(&content);
    let is_json = format == Some(Format::Json);
    let value = match format {
        #[cfg(feature = "npy")]
        Some(Format::Npy | Format::Npz) => {
            if let Some(arrays) = npy::small_arrays(path, &content, MOST_NUMBERS)? {
                return Ok((arrays.into_iter().collect(), false));
            }
            let array = npy::Array::parse(limits, path, &content, &[])?;
            match array.shape.iter().product() {
                0..=MOST_NUMBERS => Ok(array.numbers().map(Value::from).collect()),
                count => {
                    let found = format!("an array of {count} numbers");
                    Err(IoError::new(path, None, found, expected))
                }
            }
        }
        Some(Format::Json) => {
            let Unique(value) = json::parse(path, text_bytes(path, &content)?)?;
            Ok(value)
        }
        format @ (None | Some(Format::Xml | Format::Yaml)) => {
            let Ok(text) = std::str::from_utf8(text_bytes(path, &content)?) else {
                return Err(format::refuse(path, &content, expected));
            };
            match (format, lines_of_numbers(text)) {
                _ if text.trim().is_empty() => Err(IoError::new(path, None, "no text", expected)),
                (None, Some(lines)) => Ok(lines),
                #[cfg(feature = "xml")]
                (Some(Format::Xml), _) => xml::parse(path, text),
                #[cfg(not(feature = "xml"))]
                (Some(Format::Xml), _) => Err(format::without_feature(path, Format::Xml, "xml")),
                #[cfg(feature = "yaml")]
                _ => yaml::parse(path, text),
                #[cfg(not(feature = "yaml"))]
                _ => Err(format::without_feature(path, Format::Yaml, "yaml")),
            }
        }
        _ => Err(format::refuse(path, &content, expected)),
    };
    Ok((value?, is_json))
}

/// Returns the numbers of a value, and of the arrays in it, or of the member `data` of an object.
pub(crate) fn numbers(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Number(number) => Some(vec![number.as_f64()?]),
        Value::Array(items) => {
            let items: Option<Vec<_>> = items.iter().map(numbers).collect();
            Some(items?.concat())
        }
        Value::Object(members) => numbers(members.get("data")?),
        _ => None,
    }
}

/// Parses lines of numbers, separated by white space, commas or brackets. `#` starts a comment.
fn lines_of_numbers(text: &str) -> Option<Value> {
    let is_separator = |c: char| c.is_whitespace() || ",;[]()".contains(c);
    let lines = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default());
    let numbers = |line: &str| -> Option<Value> {
        let words = line.split(is_separator).filter(|word| !word.is_empty());
        words
            // A number that is not finite stays as it is written, for the message.
            .map(|word| match word.parse::<f64>().ok()? {
                number if number.is_finite() => Some(Value::from(number)),
                _ => Some(Value::from(word)),
            })
            .collect()
    };
    let lines: Option<Vec<Value>> = lines
        .map(numbers)
        .filter(|line| {
            line.as_ref()
                .is_none_or(|line| line != &Value::Array(Vec::new()))
        })
        .collect();
    lines.filter(|lines| !lines.is_empty()).map(Value::Array)
}
