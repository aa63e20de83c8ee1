//! Claims, and the rules by which intervals decide them.

use hybrid_icp::Preset;

use crate::analysis::{Analysis, Interval, Metric};

/// Largest difference between mean VSDs that counts as none.
pub const EQUIVALENT_VSD: f64 = 0.01;

/// The verdict on a claim in a study, by 95 % intervals of paired differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClaimVerdict {
    /// The claim holds, and the intervals exclude the opposite.
    Holds,
    /// The claim does not hold, and the intervals exclude that it does.
    DoesNotHold,
    /// The intervals lie within ±[`EQUIVALENT_VSD`].
    Equivalent,
    /// The study cannot decide.
    Undecided {
        /// The approximate number of cases that would decide it; `None` if it is unknown.
        ///
        /// It holds if the number of objects grows in proportion.
        cases: Option<usize>,
    },
}

use ClaimVerdict::{DoesNotHold, Equivalent, Holds, Undecided};

impl ClaimVerdict {
    /// Returns the verdict in words.
    #[must_use]
    pub fn words(self) -> String {
        match self {
            Holds => "holds".to_owned(),
            DoesNotHold => "does not hold".to_owned(),
            Equivalent => format!("equivalent within ±{EQUIVALENT_VSD}"),
            Undecided { cases: None } => "undecided".to_owned(),
            Undecided { cases: Some(cases) } => format!("undecided, about {cases} cases needed"),
        }
    }

    /// Decides whether all differences of mean VSDs are negative.
    pub(crate) fn negative(contrasts: &[Interval]) -> Self {
        Self::below_zero(contrasts, |i| i.high < 0.0, EQUIVALENT_VSD)
    }

    /// Decides whether no difference of mean VSDs is positive.
    pub(crate) fn not_positive(contrasts: &[Interval]) -> Self {
        Self::below_zero(contrasts, |i| i.high <= 0.0, EQUIVALENT_VSD)
    }

    /// Decides whether all contrasts are negative. They are not differences of mean VSDs, so that
    /// none is too small to count.
    pub(crate) fn strictly_negative(contrasts: &[Interval]) -> Self {
        Self::below_zero(contrasts, |i| i.high < 0.0, 0.0)
    }

    fn below_zero(contrasts: &[Interval], is_below: fn(&Interval) -> bool, tolerance: f64) -> Self {
        if contrasts.iter().any(|i| i.low > 0.0) {
            return DoesNotHold;
        }
        let mut open = contrasts.iter().filter(|i| !is_below(i)).peekable();
        if open.peek().is_none() {
            return Holds;
        }
        let is_wide = |i: &&Interval| !(-tolerance < i.low && i.high < tolerance);
        let needed = open.filter(is_wide).map(|i| cases_needed(*i, tolerance));
        let needed: Vec<Option<usize>> = needed.collect();
        match needed.is_empty() {
            true => Equivalent,
            false => Undecided {
                cases: needed
                    .into_iter()
                    .collect::<Option<Vec<_>>>()
                    .and_then(|n| n.into_iter().max()),
            },
        }
    }
}

/// Returns about the number of cases with which an interval around the same estimate excludes zero,
/// or a difference above `tolerance`, in two digits.
///
/// Widths shrink with the root of the number of cases, if the number of objects grows alike.
fn cases_needed(interval: Interval, tolerance: f64) -> Option<usize> {
    let half = 0.5 * (interval.high - interval.low);
    let distance = interval
        .estimate
        .abs()
        .max(tolerance - interval.estimate.abs());
    let needed = interval.cases as f64 * (half / distance).powi(2);
    if !(1.0..1e9).contains(&needed) {
        return None;
    }
    let unit = 10.0_f64.powf(needed.log10().floor() - 1.0).max(1.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Within the range above.
    let rounded = ((needed / unit).ceil() * unit) as usize;
    Some(rounded)
}

/// A claim with its verdict.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Claim {
    /// The section of the paper; `aim` or `beyond §V` if the claim is not in the paper.
    pub section: &'static str,
    /// The claim, stated as it was tested.
    pub text: String,
    /// The verdict.
    pub verdict: ClaimVerdict,
    /// The figures behind the verdict.
    pub figures: String,
}

/// Contrasts, each after its label.
pub(crate) type Evidence = Vec<(String, Interval)>;

/// Tests the claims of a section on an analysis. Groups and variants are found by name.
///
/// If the study lacks a group or a variant of the claim, every test returns `None`.
#[derive(Clone, Copy)]
pub(crate) struct Judge<'a> {
    pub(crate) analysis: &'a Analysis,
    pub(crate) section: &'static str,
    /// Number of digits of the figures.
    pub(crate) digits: usize,
}

impl<'a> Judge<'a> {
    /// Returns the paper's variants whose names start with a prefix.
    ///
    /// Claims are about these, even if a study has more.
    pub(crate) fn family(self, prefix: &str) -> Vec<&'a str> {
        let names = self.analysis.variants().iter().map(String::as_str);
        let of_paper = |name: &&str| Preset::PAPER.iter().any(|preset| preset.name() == *name);
        names
            .filter(|name| name.starts_with(prefix))
            .filter(of_paper)
            .collect()
    }

    /// Returns the labels of the single bins or levels.
    pub(crate) fn steps(self) -> impl Iterator<Item = &'a str> {
        let groups = self.analysis.groups().iter();
        groups
            .filter(|group| group.single)
            .map(|group| &*group.label)
    }

    /// Returns a sum of means times factors; a term is a group, a variant and a factor.
    pub(crate) fn contrast(self, metric: Metric, terms: &[(&str, &str, f64)]) -> Option<Interval> {
        let find = |(group, variant, factor): &(&str, &str, f64)| {
            Some((
                self.analysis.group(group)?,
                self.analysis.variant(variant)?,
                *factor,
            ))
        };
        let terms: Option<Vec<_>> = terms.iter().map(find).collect();
        self.analysis.contrast(metric, &terms?)
    }

    /// Returns the mean VSD of a variant in a group.
    pub(crate) fn vsd(self, group: &str, variant: &str) -> Option<Interval> {
        self.contrast(Metric::Vsd, &[(group, variant, 1.0)])
    }

    /// Returns the paired difference of the mean VSD of two variants in a group.
    pub(crate) fn difference(self, group: &str, a: &str, b: &str) -> Option<Interval> {
        self.contrast(Metric::Vsd, &[(group, a, 1.0), (group, b, -1.0)])
    }

    /// Returns the variant with the lowest mean VSD in a group, with that mean.
    pub(crate) fn lowest(self, group: &str, among: &[&'a str]) -> Option<(&'a str, Interval)> {
        let means = among.iter().filter_map(|v| Some((*v, self.vsd(group, v)?)));
        means.min_by(|a, b| a.1.estimate.total_cmp(&b.1.estimate))
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

    /// Decides a claim by a rule. Without evidence, returns `None`.
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

    /// Decides whether a contrast is negative.
    pub(crate) fn negative(
        self,
        text: impl Into<String>,
        found: Option<Interval>,
    ) -> Option<Claim> {
        self.decide(text, ClaimVerdict::negative, vec![(String::new(), found?)])
    }
}

/// Joins figures into one text.
pub(crate) fn listed(figures: impl IntoIterator<Item = String>) -> String {
    figures.into_iter().collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(half: f64) -> impl Fn(&f64) -> Interval {
        move |estimate: &f64| Interval {
            estimate: *estimate,
            low: estimate - half,
            high: estimate + half,
            cases: 100,
        }
    }

    #[test]
    fn verdicts_follow_the_intervals() {
        let all =
            |estimates: &[f64]| -> Vec<Interval> { estimates.iter().map(around(0.1)).collect() };
        assert_eq!(ClaimVerdict::negative(&all(&[-0.2, -0.3])), Holds);
        assert_eq!(ClaimVerdict::negative(&all(&[-0.2, 0.2])), DoesNotHold);
        assert_eq!(ClaimVerdict::not_positive(&all(&[-0.2])), Holds);
        assert_eq!(ClaimVerdict::not_positive(&all(&[-0.2, 0.2])), DoesNotHold);
        let undecided = |cases| Undecided { cases: Some(cases) };
        // Half of the width excludes zero, so four times the cases do.
        assert_eq!(ClaimVerdict::negative(&all(&[-0.2, 0.05])), undecided(400));
        assert_eq!(
            ClaimVerdict::negative(&all(&[-0.05, 0.02])),
            undecided(2500)
        );
        // Without a difference, a tenth of the width shows that there is none.
        assert_eq!(
            ClaimVerdict::not_positive(&all(&[-0.2, 0.0])),
            undecided(10_000)
        );
        assert_eq!(
            ClaimVerdict::strictly_negative(&all(&[0.0])),
            Undecided { cases: None }
        );
        let zero = [around(0.0)(&0.0)];
        assert_eq!(ClaimVerdict::not_positive(&zero), Holds);
        assert_eq!(ClaimVerdict::negative(&zero), Equivalent);
        let small = [-0.2, 0.004].map(|x| around(0.005)(&x));
        assert_eq!(ClaimVerdict::negative(&small), Equivalent);
    }

    #[test]
    fn verdicts_have_words() {
        assert_eq!(Equivalent.words(), "equivalent within ±0.01");
        let undecided = Undecided { cases: Some(3200) };
        assert_eq!(undecided.words(), "undecided, about 3200 cases needed");
    }
}
