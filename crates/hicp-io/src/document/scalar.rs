//! Values of words.

use serde_json::Value;

/// The deepest nesting of objects and arrays, as in `serde_json`.
pub(super) const DEEPEST: usize = 127;

/// Returns the value of a word: a number, or its text.
pub(super) fn scalar(text: &str) -> Value {
    let number = text
        .trim()
        .parse()
        .ok()
        .filter(|number: &f64| number.is_finite());
    number.map_or_else(|| Value::from(text), Value::from)
}
