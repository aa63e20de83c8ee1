//! Errors of pipeline files.

use thiserror::Error;

/// A place in a pipeline file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Path of the file, the name that its text was given, or the override.
    pub origin: String,
    /// Line, from 1; `None` for a value that an override set.
    pub line: Option<usize>,
    /// The field, as a dotted path with list indices from 0; empty for the whole file.
    pub field: String,
}

impl Place {
    /// The place of a field that starts at a byte of a text. Counts the lines before it, so that
    /// only errors cost the time.
    pub(crate) fn of(origin: &str, text: &str, start: Option<usize>, field: &str) -> Box<Self> {
        let before = start.map(|start| text.get(..start).unwrap_or(text));
        Box::new(Self {
            origin: origin.to_owned(),
            line: before.map(|text| text.matches('\n').count() + 1),
            field: field.to_owned(),
        })
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.origin)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.field.is_empty() {
            write!(f, ": {}", self.field)?;
        }
        Ok(())
    }
}

/// The kind of a [`PipelineError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PipelineErrorKind {
    /// A file that cannot be read.
    Read,
    /// Text that is not TOML.
    Syntax,
    /// A required field is missing.
    Missing,
    /// A name that no part of the kind has, or a field that the part does not have.
    Unknown,
    /// A value of the wrong type or out of range.
    Value,
    /// More work than [`PipelineLimits`](crate::PipelineLimits) allow.
    Limit,
    /// An override that is not of the form `path=value`, or whose path does not exist.
    Override,
}

/// A pipeline file that does not describe a pipeline.
#[derive(Debug, Error)]
#[non_exhaustive]
#[error("{place}: {problem}")]
pub struct PipelineError {
    /// The kind.
    pub kind: PipelineErrorKind,
    /// The field; the whole file or override if no field is at fault.
    pub place: Box<Place>,
    /// The defect, with the value found and what was expected.
    pub problem: String,
    pub(crate) source: Option<std::io::Error>,
}

impl PipelineError {
    pub(crate) fn new(kind: PipelineErrorKind, place: Box<Place>, problem: String) -> Self {
        Self {
            kind,
            place,
            problem,
            source: None,
        }
    }
}
