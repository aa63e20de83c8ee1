//! Values by their names, and suggestions for misspelled names.

use thiserror::Error;

/// The error for an unknown name, such as that of a preset, with a suggestion.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "no {what} is named {found:?}{} The names are: {}",
    suggestion.map_or_else(|| ".".to_owned(), |name| format!("; did you mean {name:?}?")),
    known.join(", ")
)]
pub struct UnknownName {
    /// The kind of name, such as "pipeline".
    pub what: &'static str,
    /// The name given.
    pub found: String,
    /// The most similar known name, if one is similar.
    pub suggestion: Option<&'static str>,
    /// All known names.
    pub known: Vec<&'static str>,
}

/// Returns the value with a name.
///
/// # Errors
///
/// [`UnknownName`] if none of the values has it. `what` is their kind.
pub fn named<T: Copy>(
    what: &'static str,
    text: &str,
    all: &[T],
    name: fn(T) -> &'static str,
) -> Result<T, UnknownName> {
    let found = all.iter().copied().find(|value| name(*value) == text);
    found.ok_or_else(|| {
        let known: Vec<_> = all.iter().copied().map(name).collect();
        UnknownName {
            what,
            found: text.to_owned(),
            suggestion: nearest_name(text, known.iter().copied()),
            known,
        }
    })
}

/// Returns the candidate with the fewest edits from a name.
///
/// If the edits exceed half of the letters, returns `None`.
pub fn nearest_name<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    candidates
        .into_iter()
        .map(|candidate| (edit_distance(candidate, name), candidate))
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, candidate)| 2 * distance <= candidate.len().max(name.len()))
        .map(|(_, candidate)| candidate)
}

/// Returns the Levenshtein distance in bytes.
fn edit_distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.bytes().enumerate() {
            let substituted = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
