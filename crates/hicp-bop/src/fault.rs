//! What is missing or damaged in a dataset.

use std::error::Error;

use hicp_io::IoError;

/// Why something of a dataset cannot be used; it costs the rows that need it, and no others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// It is not there, which is no fault of the dataset: parts of one are often all that one has.
    pub missing: bool,
    /// What is wrong, with path, place and what was expected.
    pub text: String,
}

impl Fault {
    /// What an error while reading says.
    #[must_use]
    pub fn of(error: &IoError) -> Self {
        Self {
            missing: matches!(error, IoError::Missing { .. }),
            text: chain(error),
        }
    }

    /// Something that is there, but cannot be used.
    #[must_use]
    pub fn damaged(text: String) -> Self {
        Self {
            missing: false,
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
