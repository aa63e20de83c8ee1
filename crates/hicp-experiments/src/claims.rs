//! Claims, and how intervals decide them.

use crate::analysis::{Analysis, Interval, Metric};

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

use ClaimVerdict::{DoesNotHold, Holds, NotSignificant};

impl ClaimVerdict {
    /// Returns the verdict in words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Holds => "holds",
            DoesNotHold => "does not hold",
            NotSignificant => "not significant",
        }
    }

    /// Returns "does not hold" if `fails`, and "holds" if `holds`.
    pub(crate) fn of(holds: bool, fails: bool) -> Self {
        match (fails, holds) {
            (true, _) => DoesNotHold,
            (false, true) => Holds,
            (false, false) => NotSignificant,
        }
    }

    /// Decides whether all contrasts are negative.
    pub(crate) fn negative(contrasts: &[Interval]) -> Self {
        let holds = contrasts.iter().all(|i| i.high < 0.0);
        Self::of(holds, contrasts.iter().any(|i| i.low > 0.0))
    }

    /// Decides whether no contrast is positive.
    pub(crate) fn not_positive(contrasts: &[Interval]) -> Self {
        let holds = contrasts.iter().all(|i| i.high <= 0.0);
        Self::of(holds, contrasts.iter().any(|i| i.low > 0.0))
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

/// Contrasts with the texts that stand before them.
pub(crate) type Evidence = Vec<(String, Interval)>;

/// Tests the claims of a section on an analysis.
#[derive(Clone, Copy)]
pub(crate) struct Judge<'a> {
    pub(crate) analysis: &'a Analysis,
    pub(crate) section: &'static str,
    /// Number of digits of the figures.
    pub(crate) digits: usize,
}

impl<'a> Judge<'a> {
    /// Returns the mean VSD of a variant in a group.
    pub(crate) fn vsd(self, group: usize, variant: usize) -> Option<Interval> {
        self.analysis.mean(Metric::Vsd, group, variant)
    }

    /// Returns the paired difference of the mean VSD of two variants in a group.
    pub(crate) fn difference(self, group: usize, a: usize, b: usize) -> Option<Interval> {
        self.analysis.difference(Metric::Vsd, group, a, b)
    }

    /// Returns the name of a variant.
    pub(crate) fn name(self, variant: usize) -> &'a str {
        &self.analysis.variants()[variant]
    }

    /// Returns the variants whose names start with a prefix.
    pub(crate) fn family(self, prefix: &str) -> Vec<usize> {
        let mut all: Vec<usize> = (0..self.analysis.variants().len()).collect();
        all.retain(|v| self.name(*v).starts_with(prefix));
        all
    }

    /// Returns a claim with its verdict.
    #[allow(clippy::unnecessary_wraps, reason = "the last line of every test")]
    pub(crate) fn claim(
        self,
        text: impl Into<String>,
        verdict: ClaimVerdict,
        figures: impl Into<String>,
    ) -> Option<Claim> {
        let (section, text, figures) = (self.section, text.into(), figures.into());
        Some(Claim {
            section,
            text,
            verdict,
            figures,
        })
    }

    /// Decides a claim by a rule; `None` without evidence.
    pub(crate) fn decide(
        self,
        text: impl Into<String>,
        rule: fn(&[Interval]) -> ClaimVerdict,
        evidence: Evidence,
    ) -> Option<Claim> {
        let (labels, contrasts): (Vec<String>, Vec<Interval>) = evidence.into_iter().unzip();
        contrasts.first()?;
        let (digits, labeled) = (self.digits, labels.iter().zip(&contrasts));
        let figures = labeled.map(|(label, i)| format!("{label}{i:+.digits$}"));
        self.claim(text, rule(&contrasts), listed(figures))
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
        let around = |half: f64| {
            move |estimate: &f64| Interval {
                estimate: *estimate,
                low: estimate - half,
                high: estimate + half,
            }
        };
        let all =
            |estimates: &[f64]| -> Vec<Interval> { estimates.iter().map(around(0.1)).collect() };
        assert_eq!(ClaimVerdict::negative(&all(&[-0.2, -0.3])), Holds);
        assert_eq!(ClaimVerdict::negative(&all(&[-0.2, 0.05])), NotSignificant);
        assert_eq!(ClaimVerdict::negative(&all(&[-0.2, 0.2])), DoesNotHold);
        assert_eq!(ClaimVerdict::not_positive(&all(&[-0.2])), Holds);
        assert_eq!(
            ClaimVerdict::not_positive(&all(&[-0.2, 0.0])),
            NotSignificant
        );
        assert_eq!(ClaimVerdict::not_positive(&all(&[0.2, -0.2])), DoesNotHold);
        let zero = [around(0.0)(&0.0)];
        assert_eq!(ClaimVerdict::not_positive(&zero), Holds);
        assert_eq!(ClaimVerdict::negative(&zero), NotSignificant);
    }
}
