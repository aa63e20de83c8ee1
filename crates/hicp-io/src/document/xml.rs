//! XML, as OpenCV writes it.

use std::path::Path;

use roxmltree::{Document, Node};
use serde_json::Value;

use super::scalar::{DEEPEST, scalar};
use crate::error::{IoError, Place};

/// Parses an XML file: elements become members, and texts of numbers become arrays.
pub(super) fn parse(path: &Path, text: &str) -> Result<Value, IoError> {
    let document = Document::parse(text).map_err(|error| {
        let place = Place::Line(error.pos().row as usize);
        let found = format!("text that is not valid XML: {error}");
        IoError::new(path, place, found, "XML with one root element")
    })?;
    Ok(value(document.root_element(), DEEPEST))
}

/// Returns the value of an element with so many levels below it.
fn value(node: Node<'_, '_>, depth: usize) -> Value {
    let elements = || node.children().filter(Node::is_element);
    if depth == 0 || elements().next().is_none() {
        let text = node.text().unwrap_or_default();
        let words: Vec<Value> = text.split_whitespace().map(scalar).collect();
        return match words.len() > 1 && words.iter().all(Value::is_number) {
            true => Value::Array(words),
            false => scalar(text),
        };
    }
    elements()
        .map(|child| (child.tag_name().name().to_owned(), value(child, depth - 1)))
        .collect()
}
