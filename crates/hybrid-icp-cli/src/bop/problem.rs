//! What is missing or damaged in a dataset, and telling it.

use std::collections::BTreeSet;

use hicp_io::IoError;

use crate::terminal::{complain, warn};

/// Why something of the dataset cannot be used.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    /// It is not there, which is no fault of the dataset: parts of one are often all that one has.
    pub(crate) missing: bool,
    pub(crate) text: String,
}

impl Problem {
    pub(crate) fn of(error: &IoError) -> Self {
        Self {
            missing: matches!(error, IoError::Missing { .. }),
            text: chain(error),
        }
    }

    pub(crate) fn damaged(text: String) -> Self {
        Self {
            missing: false,
            text,
        }
    }
}

/// The message of an error and of all its causes.
pub(crate) fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}

/// Most problems that are told one by one.
const PROBLEMS_SHOWN: usize = 10;

/// Warns of what is missing, complains about what is damaged, each once; returns how many things are damaged.
pub(crate) fn tell<'a>(
    problems: impl Iterator<Item = &'a Problem> + Clone,
    broken_models: &[String],
) -> usize {
    let texts = |missing: bool| -> Vec<String> {
        let mut seen = BTreeSet::new();
        let of_kind = problems.clone().filter(|p| p.missing == missing);
        let texts = of_kind.map(|p| p.text.clone());
        texts.filter(|text| seen.insert(text.clone())).collect()
    };
    let (missing, mut damaged) = (texts(true), broken_models.to_vec());
    damaged.extend(texts(false));
    if let Some(first) = missing.first() {
        warn(format_args!(
            "{first}{}",
            match missing.len() - 1 {
                0 => String::new(),
                more => format!(" (and {more} more like it)"),
            }
        ));
    }
    for text in damaged.iter().take(PROBLEMS_SHOWN) {
        complain(text);
    }
    damaged.len()
}
