//! What can be wrong with a pipeline file.

use thiserror::Error;

/// Where in a pipeline file something stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file's path, or what the text was called.
    pub origin: String,
    /// Line, from 1; `None` for a value that was set from outside the file.
    pub line: Option<usize>,
    /// The field, as a dotted path with list indices from 0; empty for the whole.
    pub field: String,
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
        path: std::path::PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// Text that is not TOML.
    #[error("{place}: not TOML: {message}")]
    Syntax {
        /// Where.
        place: Place,
        /// What the parser says.
        message: String,
    },
    /// A field that must be there is not.
    #[error("{place}: missing, expected {expected}")]
    Missing {
        /// The field.
        place: Place,
        /// What should be there.
        expected: String,
    },
    /// A field that means nothing here.
    #[error("{place}: {part} has no such field{}; its fields are: {}", did_you_mean(suggestion.as_deref()), list(known))]
    UnknownField {
        /// The field.
        place: Place,
        /// Name of the part that it was given to.
        part: String,
        /// The known field nearest to it.
        suggestion: Option<String>,
        /// The known fields.
        known: Vec<String>,
    },
    /// A name that no part of the kind has.
    #[error("{place}: no {kind} is named {found:?}{}; there are: {}", did_you_mean(suggestion.as_deref()), list(known))]
    UnknownPart {
        /// The field.
        place: Place,
        /// What kind of part is expected.
        kind: &'static str,
        /// The name found.
        found: String,
        /// The known name nearest to it.
        suggestion: Option<String>,
        /// The known names.
        known: Vec<String>,
    },
    /// A value of the wrong type or out of range.
    #[error("{place}: found {found}, expected {expected}")]
    Value {
        /// The field.
        place: Place,
        /// What is there.
        found: String,
        /// What should be there.
        expected: String,
    },
    /// More work than [`PipelineLimits`](super::PipelineLimits) let a file ask for.
    #[error(
        "{place}: found {found}, expected at most {limit}: raise the limit (--{} N, PipelineLimits::{field}) if that is meant",
        field.replace('_', "-")
    )]
    Limit {
        /// The field that takes it above the limit.
        place: Place,
        /// What is there, and how much that is.
        found: String,
        /// How much is accepted.
        limit: u64,
        /// The field of [`PipelineLimits`](super::PipelineLimits) that raises the limit.
        field: &'static str,
    },
    /// An override that is not of the form `path=value`, or whose path leads nowhere.
    #[error("override {assignment:?}: {problem}")]
    Override {
        /// The override as given.
        assignment: String,
        /// What is wrong with it.
        problem: String,
    },
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |name| format!("; did you mean {name:?}?"))
}

fn list(names: &[String]) -> String {
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}
