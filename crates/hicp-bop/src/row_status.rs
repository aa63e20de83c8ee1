//! What becomes of a row.

use std::fmt;

use hybrid_icp::Termination;

use crate::fault::{Fault, FaultKind};

/// What became of a row of a result file. All but [`RowStatus::Refined`] leave the row's pose as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum RowStatus {
    /// Its pose is a new one.
    Refined,
    /// The dataset has no model of its object.
    MissingModel,
    /// The dataset does not have its image, or no depth of it.
    MissingFrame,
    /// Its object has no mask in its image.
    NoMask,
    /// The model at its pose covers no pixel of a mask of its object.
    NoOverlap,
    /// Nothing was measured in the box about its pose ([`crate::MaskSource::Box`]).
    NothingMeasured,
    /// A file that it needs is damaged.
    Damaged,
    /// The pipeline kept the initial pose, and this is why.
    Kept(Termination),
}

impl RowStatus {
    /// Returns the status that is written so by its `Display`, or `None` for any other text.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let statuses = [
            Self::Refined,
            Self::MissingModel,
            Self::MissingFrame,
            Self::NoMask,
            Self::NoOverlap,
            Self::NothingMeasured,
            Self::Damaged,
        ];
        let kept = Termination::ALL.map(Self::Kept);
        let mut all = statuses.into_iter().chain(kept);
        all.find(|status| status.to_string() == text)
    }

    /// Order in which statuses are told, and of two reasons why a row has no mask the one that says more.
    fn rank(self) -> u8 {
        match self {
            Self::Refined => 0,
            Self::MissingModel => 1,
            Self::MissingFrame => 2,
            Self::NoMask => 3,
            Self::NoOverlap => 4,
            Self::NothingMeasured => 5,
            Self::Damaged => 6,
            Self::Kept(_) => 7,
        }
    }
}

impl fmt::Display for RowStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self {
            Self::Refined => "refined",
            Self::MissingModel => "kept: missing model",
            Self::MissingFrame => "kept: missing frame",
            Self::NoMask => "kept: no mask of the object",
            Self::NoOverlap => "kept: no overlap with a mask of the object",
            Self::NothingMeasured => "kept: nothing measured about the pose",
            Self::Damaged => "kept: damaged file",
            Self::Kept(reason) => return write!(f, "kept by the pipeline: {}", reason.explain()),
        };
        f.write_str(text)
    }
}

impl Ord for RowStatus {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let reason = |status: &Self| match status {
            Self::Kept(reason) => reason.explain(),
            _ => "",
        };
        let ranks = self.rank().cmp(&other.rank());
        ranks.then_with(|| reason(self).cmp(reason(other)))
    }
}

impl PartialOrd for RowStatus {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl From<&Fault> for RowStatus {
    fn from(fault: &Fault) -> Self {
        match fault.kind {
            FaultKind::Missing => Self::MissingFrame,
            FaultKind::MissingMask => Self::NoMask,
            FaultKind::Damaged => Self::Damaged,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fate_is_read_as_it_is_written() {
        for status in Termination::ALL
            .map(RowStatus::Kept)
            .into_iter()
            .chain([RowStatus::Refined, RowStatus::NothingMeasured])
        {
            assert_eq!(RowStatus::parse(&status.to_string()), Some(status));
        }
        assert_eq!(RowStatus::parse("kept"), None);
        assert!(
            RowStatus::NoMask < RowStatus::NoOverlap && RowStatus::NoOverlap < RowStatus::Damaged
        );
    }
}
