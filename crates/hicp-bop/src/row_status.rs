//! The status of a row after refinement.

use std::fmt;

use hybrid_icp::icp::Termination;
use serde::{Deserialize, Serialize};

use crate::fault::{Fault, FaultKind};

/// The status of a row of a result file. All except [`RowStatus::Refined`] keep the row's pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
#[non_exhaustive]
pub enum RowStatus {
    /// The row has a new pose.
    Refined,
    /// The dataset has no model of the row's object.
    MissingModel,
    /// The dataset does not have the row's image or its depth.
    MissingFrame,
    /// The object has no mask in the image.
    NoMask,
    /// At the row's pose, the model covers no pixel of any mask of its object.
    NoOverlap,
    /// There are no measurements in the box around the row's pose ([`crate::MaskSource::Box`]), or
    /// in the mask of its detection ([`crate::MaskSource::OfRows`]).
    NothingMeasured,
    /// A file that the row needs is damaged.
    Damaged,
    /// The pipeline kept the initial pose for this reason.
    Kept(Termination),
}

impl RowStatus {
    /// Returns the status that `Display` formats as `text`, or `None` for any other text.
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

    /// Returns the rank in summaries and the text.
    ///
    /// If there are two reasons for a missing mask, the one with the higher rank is more specific.
    fn parts(self) -> (u8, &'static str) {
        match self {
            Self::Refined => (0, "refined"),
            Self::MissingModel => (1, "kept: missing model"),
            Self::MissingFrame => (2, "kept: missing frame"),
            Self::NoMask => (3, "kept: no mask of the object"),
            Self::NoOverlap => (4, "kept: no overlap with a mask of the object"),
            Self::NothingMeasured => (5, "kept: nothing measured about the pose"),
            Self::Damaged => (6, "kept: damaged file"),
            Self::Kept(reason) => (7, reason.explain()),
        }
    }
}

impl fmt::Display for RowStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if matches!(self, Self::Kept(_)) {
            f.write_str("kept by the pipeline: ")?;
        }
        f.write_str(self.parts().1)
    }
}

impl Ord for RowStatus {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.parts().cmp(&other.parts())
    }
}

impl PartialOrd for RowStatus {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl From<RowStatus> for String {
    fn from(status: RowStatus) -> Self {
        status.to_string()
    }
}

impl TryFrom<String> for RowStatus {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        Self::parse(&text).ok_or_else(|| format!("{text:?} is not the status of a row"))
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
    fn every_status_is_parsed_back_from_its_text() {
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
