//! The kinds of parts.

/// The role of a part in a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PartKind {
    /// A composition or an ICP stage.
    Stage,
    /// Selects the points.
    Selection,
    /// Pairs them.
    Association,
    /// Removes or re-weights pairs.
    Filter,
    /// Is minimized.
    Metric,
    /// Ends a stage.
    Stop,
    /// Judges a pose.
    Score,
    /// Selects a stage.
    Switcher,
}

impl PartKind {
    /// Returns the name in messages.
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

    /// Returns the name with its article.
    pub(crate) fn any(self) -> String {
        let article = if self == Self::Association { "an" } else { "a" };
        format!("{article} {}", self.name())
    }
}

/// A boxed trait of a pipeline, such as `BoxedMetric`: a part that other parts can hold.
pub trait BoxedPart: Sized + 'static {
    /// The kind of the part.
    const KIND: PartKind;

    /// Returns any part of this kind, for building a holder whose parameters are being listed.
    #[doc(hidden)]
    fn stand_in() -> Self;
}
