//! Errors of pipeline files.

use std::path::PathBuf;

use thiserror::Error;

/// A place in a pipeline file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Path of the file, or the name that its text was given.
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

/// A pipeline file that does not describe a pipeline.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// A file that cannot be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// Text that is not TOML.
    #[error("{place}: not TOML: {message}")]
    Syntax {
        /// The place in the file.
        place: Box<Place>,
        /// The message of the parser.
        message: String,
    },
    /// A required field is missing.
    #[error("{place}: missing, expected {expected}")]
    Missing {
        /// The field.
        place: Box<Place>,
        /// The values that are accepted.
        expected: String,
    },
    /// A name that no part of the kind has, or a field that the part does not have.
    #[error("{place}: {problem}{}; there are: {}", did_you_mean(suggestion.as_deref()), list(known))]
    Unknown {
        /// The field.
        place: Box<Place>,
        /// The message: the unknown name and its kind.
        problem: String,
        /// The known name nearest to it, or the path of such a field in an inner part.
        suggestion: Option<String>,
        /// The known names.
        known: Vec<String>,
    },
    /// A value of the wrong type or out of range.
    #[error("{place}: found {found}, expected {expected}")]
    Value {
        /// The field.
        place: Box<Place>,
        /// The value found.
        found: String,
        /// The values that are accepted.
        expected: String,
    },
    /// More work than [`PipelineLimits`](crate::PipelineLimits) allow.
    #[error(
        "{place}: found {found}, expected at most {limit}: raise the limit (--{} N, PipelineLimits::{field}) if that is meant",
        field.replace('_', "-")
    )]
    Limit {
        /// The field that exceeds the limit.
        place: Box<Place>,
        /// The value found, and the work that it stands for.
        found: String,
        /// The largest value that is accepted.
        limit: u64,
        /// The field of [`PipelineLimits`](crate::PipelineLimits) that raises the limit.
        field: &'static str,
    },
    /// An override that is not of the form `path=value`, or whose path leads nowhere.
    #[error("override {assignment:?}: {problem}")]
    Override {
        /// The override as given.
        assignment: String,
        /// The defect.
        problem: String,
    },
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |name| format!("; did you mean {name:?}?"))
}

fn list(names: &[String]) -> String {
    match names {
        [] => "none".to_owned(),
        _ => names.join(", "),
    }
}
