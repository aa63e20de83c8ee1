//! What is missing or damaged in a dataset.

use std::error::Error;

use hicp_io::{IoError, IoErrorKind};
use serde::{Deserialize, Serialize};

/// What is the matter with a part of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultKind {
    /// It is not there, which is no fault of the dataset: parts of one are often all that one has.
    Missing,
    /// The same, of masks of an image that is there.
    MissingMask,
    /// It is there, but cannot be used.
    Damaged,
}

/// Why something of a dataset cannot be used; it costs the rows that need it, and no others.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// What is the matter with it.
    pub kind: FaultKind,
    /// What is wrong, with path, place and what was expected.
    pub text: String,
}

impl Fault {
    /// What an error while reading says.
    #[must_use]
    pub fn of(error: &IoError) -> Self {
        Self {
            kind: match error.kind {
                IoErrorKind::Missing => FaultKind::Missing,
                _ => FaultKind::Damaged,
            },
            text: chain(error),
        }
    }

    /// Something that is there, but cannot be used.
    #[must_use]
    pub fn damaged(text: String) -> Self {
        Self {
            kind: FaultKind::Damaged,
            text,
        }
    }
}

/// Returns the message of an error and of all its causes, as one line.
#[must_use]
pub fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}
