//! The entries of a catalog.

use std::fmt;

use crate::kind::PartKind;

/// A part: its names, its role and its parameters.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Part {
    /// Its role in a pipeline.
    pub kind: PartKind,
    /// Name in files.
    pub name: &'static str,
    /// Name of the type in Rust.
    pub rust: &'static str,
    /// Its effect, source and cost.
    pub about: &'static str,
    /// Its parameters, in the order in which they are read.
    pub parameters: Vec<Parameter>,
}

/// A parameter of a part.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Parameter {
    /// Name in files.
    pub name: &'static str,
    /// Unit; empty for none.
    pub unit: &'static str,
    /// Its meaning.
    pub meaning: &'static str,
    /// The values that it accepts, and the default.
    pub accepts: Accepts,
}

/// The values that a parameter accepts, and the one that it has when a file does not set it.
#[derive(Clone, Debug, PartialEq)]
pub enum Accepts {
    /// A number in a range, both ends included.
    Number {
        /// Smallest number.
        min: f64,
        /// Largest number.
        max: f64,
        /// Default; `None` if the parameter is required.
        default: Option<f64>,
    },
    /// A whole number.
    Count {
        /// Smallest number.
        min: u32,
        /// Default; `None` if the parameter is required.
        default: Option<u32>,
    },
    /// True or false.
    Flag {
        /// Default.
        default: bool,
    },
    /// One of some words; the first is the default.
    Word {
        /// The words.
        words: Vec<&'static str>,
    },
    /// A list of numbers, which is required.
    NumberList,
    /// A list of flags, all false by default.
    Flags {
        /// Number of flags.
        count: usize,
    },
    /// A part.
    Part {
        /// Its kind.
        kind: PartKind,
        /// Default name; `None` if the parameter is required.
        default: Option<&'static str>,
    },
    /// A list of parts.
    Parts {
        /// Their kind.
        kind: PartKind,
        /// Default names; `None` if the parameter is required.
        default: Option<&'static [&'static str]>,
    },
}

impl Parameter {
    pub(crate) fn new(
        name: &'static str,
        unit: &'static str,
        meaning: &'static str,
        accepts: Accepts,
    ) -> Self {
        Self {
            name,
            unit,
            meaning,
            accepts,
        }
    }
}

impl fmt::Display for Accepts {
    /// Writes what is expected, as error messages and the catalog state it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number { min, max, .. } => write!(f, "a number from {min} to {max}"),
            Self::Count { min, .. } => write!(f, "a whole number of {min} or more"),
            Self::Flag { .. } => f.write_str("true or false"),
            Self::Word { words } => write!(f, "one of {}", words.join(", ")),
            Self::NumberList => f.write_str("a list of numbers"),
            Self::Flags { count } => write!(f, "a list of {count} of true and false"),
            Self::Part { kind, .. } => f.write_str(&kind.any()),
            Self::Parts { kind, .. } => write!(f, "a list of {}s", kind.name()),
        }
    }
}

impl Accepts {
    /// Returns the default as the catalog states it; `None` if the parameter is required.
    #[must_use]
    pub fn default(&self) -> Option<String> {
        match self {
            Self::Number { default, .. } => default.map(|number| number.to_string()),
            Self::Count { default, .. } => default.map(|count| count.to_string()),
            Self::Flag { default } => Some(default.to_string()),
            Self::Word { words } => words.first().map(ToString::to_string),
            Self::NumberList => None,
            Self::Flags { .. } => Some("all false".to_owned()),
            Self::Part { default, .. } => default.map(str::to_owned),
            Self::Parts { default, .. } => default.map(|names| match names {
                [] => "none".to_owned(),
                _ => names.join(", "),
            }),
        }
    }
}
