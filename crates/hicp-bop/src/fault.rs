//! Faults of a dataset: missing and damaged files.

use std::error::Error;

use hicp_io::{IoError, IoErrorKind};
use serde::{Deserialize, Serialize};

/// The kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultKind {
    /// A file is missing. This is common, because many users have only a part of a dataset.
    Missing,
    /// A mask of an image is missing, or the ground truth that lists its masks.
    MissingMask,
    /// A file exists but cannot be used.
    Damaged,
}

/// The reason why a file of a dataset cannot be used. Only rows that need the file are affected.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// The message: path, place, the value found and the value expected.
    pub text: String,
}

impl Fault {
    /// Converts the error of a reader to a fault.
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

    /// Creates the fault of a file that exists but cannot be used.
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
