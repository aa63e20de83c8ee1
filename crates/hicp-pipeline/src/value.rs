//! TOML values: how messages name them, and how overrides set them.

use std::borrow::Cow;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{PipelineError, PipelineErrorKind, Place};

/// The position of a value that an override set, which has no place in the file.
pub(crate) const NOWHERE: usize = usize::MAX;

/// Returns the name of a value in messages.
pub(crate) fn describe(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text {text:?}"),
        DeValue::Integer(number) => number.to_string(),
        DeValue::Float(number) => number.to_string(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(date) => format!("the date {date}"),
        DeValue::Array(list) => format!("a list of {}", list.len()),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// Returns a whole number, if the value is one that fits.
pub(crate) fn integer(value: &DeValue<'_>) -> Option<i64> {
    match value {
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok(),
        _ => None,
    }
}

/// Returns a number, whole or not.
#[allow(clippy::cast_precision_loss, reason = "a number in a file")]
pub(crate) fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(number) => number.as_str().parse().ok(),
        _ => integer(value).map(|number| number as f64),
    }
}

/// Returns a list, if every item is what `item` accepts.
pub(crate) fn list<T>(
    value: &DeValue<'_>,
    item: impl Fn(&DeValue<'_>) -> Option<T>,
) -> Option<Vec<T>> {
    let items = value.as_array()?;
    items.iter().map(|value| item(value.get_ref())).collect()
}

/// Applies an override, `path=value`; a last key that is not there is added.
///
/// A field that the root lacks, but the table `stage` inside has, is that of the inner stage.
pub(crate) fn set<'a>(
    root: &mut Spanned<DeValue<'a>>,
    assignment: &'a str,
) -> Result<(), PipelineError> {
    let refuse = |problem: String| {
        let place = Place::of(&format!("override {assignment:?}"), "", None, "");
        PipelineError::new(PipelineErrorKind::Override, place, problem)
    };
    let Some((path, value)) = assignment.split_once('=') else {
        return Err(refuse("expected path=value".to_owned()));
    };
    let value = parse(value.trim())
        .ok_or_else(|| refuse(format!("{value:?} is more than one TOML value")))?;
    let value = Spanned::new(NOWHERE..NOWHERE, value);

    let mut keys: Vec<&str> = path.trim().split('.').collect();
    if let Some(table) = root.get_ref().as_table()
        && !table.contains_key(keys[0])
        && let Some(stage) = table.get("stage").and_then(|s| s.get_ref().as_table())
        && stage.contains_key(keys[0])
    {
        keys.insert(0, "stage");
    }
    let mut node = root;
    for (depth, key) in keys.iter().enumerate() {
        let so_far = match depth {
            0 => "the pipeline".to_owned(),
            _ => format!("{:?}", keys[..depth].join(".")),
        };
        let last = depth + 1 == keys.len();
        // A part that is given by its bare name becomes a table with a field `type`.
        if last && node.get_ref().is_str() {
            let (span, name) = (node.span(), node.get_ref().clone());
            let mut table = DeTable::new();
            table.insert(
                Spanned::new(span.clone(), "type".into()),
                Spanned::new(span, name),
            );
            *node.get_mut() = DeValue::Table(table);
        }
        node = match node.get_mut() {
            DeValue::Table(table) => {
                if last && !table.contains_key(*key) {
                    let key = Spanned::new(NOWHERE..NOWHERE, (*key).into());
                    table.insert(key, value.clone());
                }
                table
                    .get_mut(*key)
                    .ok_or_else(|| refuse(format!("{so_far} has no {key:?}")))?
            }
            DeValue::Array(list) => {
                let count = list.len();
                let item = key.parse::<usize>().ok().and_then(|i| list.get_mut(i));
                item.ok_or_else(|| {
                    refuse(format!(
                        "{so_far} is a list of {count}, expected an index below that"
                    ))
                })?
            }
            other => {
                let found = describe(other);
                return Err(refuse(format!("{so_far} is {found}, expected a table")));
            }
        };
    }
    *node = value;
    Ok(())
}

/// Parses the value of an override. Anything that is not TOML is a text, so that quotes need not
/// survive a shell. Returns `None` for several lines that are not one value.
fn parse(value: &str) -> Option<DeValue<'_>> {
    match DeValue::parse(value) {
        Ok(value) => Some(value.into_inner()),
        Err(_) if value.contains('\n') => None,
        Err(_) => Some(DeValue::String(Cow::Borrowed(value))),
    }
}
