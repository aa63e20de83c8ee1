//! What the paper finds about fusing (§VI-C), held against a study.

use super::config::TrajectoryConfig;
use super::rule::FusionRule;
use super::study::variant;
use crate::analysis::{Analysis, HIGH, Interval, LOW, Metric};
use crate::claims::{Claim, ClaimVerdict};

/// The methods of the paper that make no use of uncertainty, with those that are the same but for it.
const WEIGHTED: [(&str, &str); 2] = [
    ("weighted-average", "average"),
    ("filtering", "filtering-constant"),
];
const AVERAGE: &str = "average";
const BEYOND: [&str; 3] = [
    "gated-average",
    "gated-weighted-average",
    "calibrated-weighted-average",
];
const HYBRID: &str = "hybrid";
const CASCADE: &str = "projective-cascade-point-plane";
const SECTION: &str = "§VI-C";

/// Tests the paper's findings, and what goes beyond it; those whose pipelines or methods the study lacks are left out.
pub(crate) fn claims(config: &TrajectoryConfig, analysis: &Analysis) -> Vec<Claim> {
    let mut found = Vec::new();
    for underlying in &config.underlying {
        let tester = Tester {
            analysis,
            underlying: &underlying.name,
            methods: config
                .methods
                .iter()
                .map(String::as_str)
                .filter(|m| is_of_paper(m))
                .collect(),
        };
        found.extend(tester.no_clear_best());
        found.extend(tester.average_as_good());
        found.extend(tester.weighting_no_better());
        found.extend(tester.better_than_average());
    }
    found.extend(pipelines(config, analysis, LOW, CASCADE, HYBRID));
    found.extend(pipelines(config, analysis, HIGH, HYBRID, CASCADE));
    found
}

struct Tester<'a> {
    analysis: &'a Analysis,
    underlying: &'a str,
    /// The paper's.
    methods: Vec<&'a str>,
}

impl Tester<'_> {
    fn variant(&self, method: &str) -> Option<usize> {
        self.analysis.variant(&variant(self.underlying, method))
    }

    /// The paired difference A − B of the mean VSD over all bins.
    fn difference(&self, a: &str, b: &str) -> Option<Interval> {
        let (a, b) = (self.variant(a)?, self.variant(b)?);
        let all = self.analysis.overall();
        self.analysis
            .contrast(Metric::Vsd, &[(all, a, 1.0), (all, b, -1.0)])
    }

    fn mean(&self, method: &str) -> Option<f64> {
        let all = self.analysis.overall();
        let mean = self
            .analysis
            .mean(Metric::Vsd, all, self.variant(method)?)?;
        Some(mean.estimate)
    }

    fn claim(&self, text: &str, verdict: ClaimVerdict, figures: Vec<String>) -> Claim {
        Claim {
            section: SECTION,
            text: format!("{}: {text}", self.underlying),
            verdict,
            figures: figures.join("; "),
        }
    }

    fn no_clear_best(&self) -> Option<Claim> {
        let mut ranked: Vec<(&str, f64)> = self
            .methods
            .iter()
            .filter_map(|m| Some((*m, self.mean(m)?)))
            .collect();
        ranked.sort_by(|a, b| a.1.total_cmp(&b.1));
        let ((best, mean), others) = ranked.split_first()?;
        let against: Vec<(&str, Interval)> = others
            .iter()
            .filter_map(|(m, _)| Some((*m, self.difference(best, m)?)))
            .collect();
        if against.is_empty() {
            return None;
        }
        let clear = against.iter().all(|(_, i)| i.high < 0.0);
        let mut figures = vec![format!("lowest: {best}, {mean:.4}")];
        figures.extend(against.iter().map(|(m, i)| format!("− {m}: {}", told(*i))));
        Some(self.claim(
            "no method is clearly best (better than each other one, its interval excluding zero)",
            if clear {
                ClaimVerdict::DoesNotHold
            } else {
                ClaimVerdict::Holds
            },
            figures,
        ))
    }

    fn average_as_good(&self) -> Option<Claim> {
        let others = self.methods.iter().filter(|m| **m != AVERAGE);
        let differences: Vec<(String, Interval)> = others
            .filter_map(|m| Some((format!("− {m}"), self.difference(AVERAGE, m)?)))
            .collect();
        let (verdict, figures) = not_above(&differences)?;
        Some(self.claim(
            "average is at least as good as each other method",
            verdict,
            figures,
        ))
    }

    fn weighting_no_better(&self) -> Option<Claim> {
        let differences: Vec<(String, Interval)> = WEIGHTED
            .into_iter()
            .filter_map(|(with, without)| {
                Some((
                    format!("{without} − {with}"),
                    self.difference(without, with)?,
                ))
            })
            .collect();
        let (verdict, figures) = not_above(&differences)?;
        Some(self.claim(
            "weighting by the MVE is no better than weighing all alike",
            verdict,
            figures,
        ))
    }

    fn better_than_average(&self) -> Vec<Claim> {
        let tested = BEYOND.into_iter().filter_map(|method| {
            let difference = self.difference(method, AVERAGE)?;
            Some(Claim {
                section: "beyond §V",
                ..self.claim(
                    &format!("{method} is better than average"),
                    below(&[difference]),
                    vec![told(difference)],
                )
            })
        });
        tested.collect()
    }
}

pub(super) fn is_of_paper(method: &str) -> bool {
    FusionRule::from_name(method).is_some_and(FusionRule::is_of_paper)
}

/// Whether one pipeline is better than another in a range of bins, over the paper's methods together and with each.
fn pipelines(
    config: &TrajectoryConfig,
    analysis: &Analysis,
    label: &str,
    better: &str,
    worse: &str,
) -> Option<Claim> {
    let group = analysis.group(label)?;
    let methods = config.methods.iter().filter(|m| is_of_paper(m));
    let pairs: Vec<(&str, usize, usize)> = methods
        .filter_map(|m| {
            Some((
                m.as_str(),
                analysis.variant(&variant(better, m))?,
                analysis.variant(&variant(worse, m))?,
            ))
        })
        .collect();
    if pairs.is_empty() {
        return None;
    }
    let share = 1.0 / pairs.len() as f64;
    let terms: Vec<(usize, usize, f64)> = pairs
        .iter()
        .flat_map(|(_, a, b)| [(group, *a, share), (group, *b, -share)])
        .collect();
    let together = analysis.contrast(Metric::Vsd, &terms)?;
    let mut figures = vec![format!("mean over the methods: {}", told(together))];
    for (method, a, b) in &pairs {
        let terms = [(group, *a, 1.0), (group, *b, -1.0)];
        let difference = analysis.contrast(Metric::Vsd, &terms)?;
        figures.push(format!("{method}: {}", told(difference)));
    }
    Some(Claim {
        section: SECTION,
        text: format!("{better} is better than {worse} at {label} initial VSD"),
        verdict: below(&[together]),
        figures: figures.join("; "),
    })
}

/// The verdict on all differences being below zero.
fn below(differences: &[Interval]) -> ClaimVerdict {
    if differences.iter().all(|i| i.high < 0.0) {
        ClaimVerdict::Holds
    } else if differences.iter().any(|i| i.low > 0.0) {
        ClaimVerdict::DoesNotHold
    } else {
        ClaimVerdict::NotSignificant
    }
}

/// The verdict on no difference being above zero, with the figures.
fn not_above(differences: &[(String, Interval)]) -> Option<(ClaimVerdict, Vec<String>)> {
    if differences.is_empty() {
        return None;
    }
    let verdict = if differences.iter().all(|(_, i)| i.high <= 0.0) {
        ClaimVerdict::Holds
    } else if differences.iter().any(|(_, i)| i.low > 0.0) {
        ClaimVerdict::DoesNotHold
    } else {
        ClaimVerdict::NotSignificant
    };
    let figures = differences
        .iter()
        .map(|(name, i)| format!("{name}: {}", told(*i)));
    Some((verdict, figures.collect()))
}

fn told(i: Interval) -> String {
    format!("{:+.4} [{:+.4}, {:+.4}]", i.estimate, i.low, i.high)
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
        assert_eq!(below(&[at(-0.2), at(-0.3)]), ClaimVerdict::Holds);
        assert_eq!(below(&[at(-0.2), at(0.05)]), ClaimVerdict::NotSignificant);
        assert_eq!(below(&[at(-0.2), at(0.2)]), ClaimVerdict::DoesNotHold);
        let named = |x: f64| ("a".to_owned(), at(x));
        let verdict = |all: &[(String, Interval)]| not_above(all).map(|(verdict, _)| verdict);
        assert_eq!(verdict(&[named(-0.2)]), Some(ClaimVerdict::Holds));
        assert_eq!(
            verdict(&[named(-0.2), named(0.0)]),
            Some(ClaimVerdict::NotSignificant)
        );
        assert_eq!(
            verdict(&[named(0.2), named(-0.2)]),
            Some(ClaimVerdict::DoesNotHold)
        );
        assert_eq!(verdict(&[]), None);
    }
}
