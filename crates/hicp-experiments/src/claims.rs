//! Claims, and how intervals decide them.

use crate::analysis::Interval;

/// Whether a claim holds in a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClaimVerdict {
    /// It holds, and the intervals exclude the opposite.
    Holds,
    /// It does not hold, and the intervals exclude that it does.
    DoesNotHold,
    /// The study cannot decide.
    NotSignificant,
}

impl ClaimVerdict {
    /// Returns the verdict in words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::DoesNotHold => "does not hold",
            Self::NotSignificant => "not significant",
        }
    }

    /// Returns "holds" or "does not hold".
    pub(crate) fn of(holds: bool) -> Self {
        if holds {
            Self::Holds
        } else {
            Self::DoesNotHold
        }
    }

    /// Decides that all contrasts are negative.
    pub(crate) fn negative<'a>(contrasts: impl IntoIterator<Item = &'a Interval>) -> Self {
        Self::decide(contrasts, |contrast| contrast.high < 0.0)
    }

    /// Decides that no contrast is positive.
    pub(crate) fn not_positive<'a>(contrasts: impl IntoIterator<Item = &'a Interval>) -> Self {
        Self::decide(contrasts, |contrast| contrast.high <= 0.0)
    }

    /// Returns that it holds if `holds` for all contrasts, and that it does not if one is positive.
    fn decide<'a>(
        contrasts: impl IntoIterator<Item = &'a Interval>,
        holds: fn(&Interval) -> bool,
    ) -> Self {
        let mut verdict = Self::Holds;
        for contrast in contrasts {
            if contrast.low > 0.0 {
                return Self::DoesNotHold;
            }
            if !holds(contrast) {
                verdict = Self::NotSignificant;
            }
        }
        verdict
    }
}

/// A claim with its verdict.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Claim {
    /// Where the paper makes it; `aim` if it is not the paper's.
    pub section: &'static str,
    /// The claim, with what was tested.
    pub text: String,
    /// The verdict.
    pub verdict: ClaimVerdict,
    /// The figures that decided.
    pub figures: String,
}

impl Claim {
    pub(crate) fn new(
        section: &'static str,
        text: impl Into<String>,
        verdict: ClaimVerdict,
        figures: impl Into<String>,
    ) -> Self {
        Self {
            section,
            text: text.into(),
            verdict,
            figures: figures.into(),
        }
    }
}

/// Joins figures for people.
pub(crate) fn listed(figures: impl IntoIterator<Item = String>) -> String {
    figures.into_iter().collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_follow_the_intervals() {
        let at = |estimate: f64| Interval {
            estimate,
            low: estimate - 0.1,
            high: estimate + 0.1,
        };
        let negative =
            |all: &[f64]| ClaimVerdict::negative(&all.iter().copied().map(at).collect::<Vec<_>>());
        assert_eq!(negative(&[-0.2, -0.3]), ClaimVerdict::Holds);
        assert_eq!(negative(&[-0.2, 0.05]), ClaimVerdict::NotSignificant);
        assert_eq!(negative(&[-0.2, 0.2]), ClaimVerdict::DoesNotHold);
        let not_positive = |all: &[f64]| {
            ClaimVerdict::not_positive(&all.iter().copied().map(at).collect::<Vec<_>>())
        };
        assert_eq!(not_positive(&[-0.2]), ClaimVerdict::Holds);
        assert_eq!(not_positive(&[-0.2, 0.0]), ClaimVerdict::NotSignificant);
        assert_eq!(not_positive(&[0.2, -0.2]), ClaimVerdict::DoesNotHold);
        let zero = Interval {
            estimate: 0.0,
            low: 0.0,
            high: 0.0,
        };
        assert_eq!(ClaimVerdict::not_positive([&zero]), ClaimVerdict::Holds);
        assert_eq!(
            ClaimVerdict::negative([&zero]),
            ClaimVerdict::NotSignificant
        );
    }
}
