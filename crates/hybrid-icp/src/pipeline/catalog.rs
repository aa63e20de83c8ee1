//! Every part that a pipeline file can name, with its parameters: the one table that files are read by and that the
//! catalogue page is written from.

/// What a part does in a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PartKind {
    /// A composition or an ICP stage.
    Stage,
    /// Chooses the points.
    Selection,
    /// Pairs them.
    Association,
    /// Removes or re-weights pairs.
    Filter,
    /// Is minimised.
    Metric,
    /// Ends a stage.
    Stop,
    /// Judges a pose.
    Score,
    /// Chooses a stage.
    Switcher,
}

impl PartKind {
    /// Every kind, in the order of the catalogue.
    pub const ALL: [Self; 8] = [
        Self::Stage,
        Self::Selection,
        Self::Association,
        Self::Filter,
        Self::Metric,
        Self::Stop,
        Self::Score,
        Self::Switcher,
    ];

    /// Name in messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stage => "stage",
            Self::Selection => "selection",
            Self::Association => "association",
            Self::Filter => "filter",
            Self::Metric => "metric",
            Self::Stop => "stop rule",
            Self::Score => "score",
            Self::Switcher => "switcher",
        }
    }
}

/// What a parameter takes, and what it is when the file does not say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Accepts {
    /// A number in a range, both ends included.
    Number {
        /// Smallest.
        min: f64,
        /// Largest.
        max: f64,
        /// Default; `None` if it must be given.
        default: Option<f64>,
    },
    /// A whole number.
    Count {
        /// Smallest.
        min: u32,
        /// Default; `None` if it must be given.
        default: Option<u32>,
    },
    /// True or false.
    Flag {
        /// Default.
        default: bool,
    },
    /// One of some words.
    Word {
        /// The words.
        words: &'static [&'static str],
        /// Default.
        default: &'static str,
    },
    /// A list of numbers, which must be given.
    NumberList,
    /// A list of true and false, all false by default.
    Flags {
        /// How many.
        count: usize,
    },
    /// A part.
    Part {
        /// Of this kind.
        kind: PartKind,
        /// Default name; `None` if it must be given.
        default: Option<&'static str>,
    },
    /// A list of parts.
    Parts {
        /// Of this kind.
        kind: PartKind,
        /// Default names; `None` if they must be given.
        default: Option<&'static [&'static str]>,
    },
}

/// A parameter of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name in files.
    pub name: &'static str,
    /// Unit; empty for none.
    pub unit: &'static str,
    /// What it means.
    pub meaning: &'static str,
    /// What it takes.
    pub accepts: Accepts,
}

/// A part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// What it does in a pipeline.
    pub kind: PartKind,
    /// Name in files.
    pub name: &'static str,
    /// Name of the type in Rust.
    pub rust: &'static str,
    /// What it does, in a line.
    pub summary: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// What it costs; n source points, m observed ones.
    pub cost: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
}
