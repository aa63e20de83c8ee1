//! The paper's findings about fusing (§VI-C), tested.

use super::config::TrajectoryConfig;
use crate::analysis::{Analysis, Interval, Metric};
use crate::claims::{Claim, ClaimVerdict, listed};
use crate::study::{HIGH, LOW};

/// The methods of the paper that use uncertainty, each with its counterpart that does not.
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

/// Tests the findings, and what goes beyond them; those whose pipelines or methods the study lacks are left out.
pub(super) fn claims(config: &TrajectoryConfig, analysis: &Analysis) -> Vec<Claim> {
    let methods = config.paper_methods();
    let mut found = Vec::new();
    for underlying in &config.underlying {
        let judge = Judge {
            analysis,
            underlying: &underlying.name,
            methods: &methods,
        };
        found.extend(judge.no_clear_best());
        found.extend(judge.average_as_good());
        found.extend(judge.weighting_no_better());
        found.extend(
            BEYOND
                .iter()
                .filter_map(|method| judge.better_than_average(method)),
        );
    }
    found.extend(is_better(analysis, &methods, LOW, [CASCADE, HYBRID]));
    found.extend(is_better(analysis, &methods, HIGH, [HYBRID, CASCADE]));
    found
}

/// Tests claims about the methods with one underlying pipeline.
struct Judge<'a> {
    analysis: &'a Analysis,
    underlying: &'a str,
    /// Those of the paper.
    methods: &'a [&'a str],
}

impl Judge<'_> {
    fn variant(&self, method: &str) -> Option<usize> {
        self.analysis
            .variant(&TrajectoryConfig::variant(self.underlying, method))
    }

    /// Returns the paired difference of the mean VSD of two methods over all bins.
    fn difference(&self, a: &str, b: &str) -> Option<Interval> {
        let (a, b) = (self.variant(a)?, self.variant(b)?);
        self.analysis
            .difference(Metric::Vsd, self.analysis.overall(), a, b)
    }

    fn claim(
        &self,
        section: &'static str,
        text: &str,
        verdict: ClaimVerdict,
        figures: String,
    ) -> Claim {
        Claim::new(
            section,
            format!("{}: {text}", self.underlying),
            verdict,
            figures,
        )
    }

    fn no_clear_best(&self) -> Option<Claim> {
        let mean = |method: &str| {
            let (all, variant) = (self.analysis.overall(), self.variant(method)?);
            Some(self.analysis.mean(Metric::Vsd, all, variant)?.estimate)
        };
        let means = self.methods.iter().filter_map(|m| Some((*m, mean(m)?)));
        let mut ranked: Vec<(&str, f64)> = means.collect();
        ranked.sort_by(|a, b| a.1.total_cmp(&b.1));
        let ((best, mean), others) = ranked.split_first()?;
        let against = others
            .iter()
            .filter_map(|(m, _)| Some((*m, self.difference(best, m)?)));
        let against: Vec<(&str, Interval)> = against.collect();
        against.first()?;
        let is_clear = against.iter().all(|(_, i)| i.high < 0.0);
        let figures = against.iter().map(|(m, i)| format!("− {m}: {i:+.4}"));
        let lowest = format!("lowest: {best}, {mean:.4}");
        Some(self.claim(
            SECTION,
            "no method is clearly best (better than each other one, its interval excluding zero)",
            ClaimVerdict::of(!is_clear),
            listed(std::iter::once(lowest).chain(figures)),
        ))
    }

    /// Tests that no named difference is above zero.
    fn not_above(&self, text: &str, differences: Vec<(String, Interval)>) -> Option<Claim> {
        differences.first()?;
        let verdict = ClaimVerdict::not_positive(differences.iter().map(|d| &d.1));
        let figures = differences
            .iter()
            .map(|(name, i)| format!("{name}: {i:+.4}"));
        Some(self.claim(SECTION, text, verdict, listed(figures)))
    }

    fn average_as_good(&self) -> Option<Claim> {
        let others = self.methods.iter().filter(|m| **m != AVERAGE);
        let differences =
            others.filter_map(|m| Some((format!("− {m}"), self.difference(AVERAGE, m)?)));
        self.not_above(
            "average is at least as good as each other method",
            differences.collect(),
        )
    }

    fn weighting_no_better(&self) -> Option<Claim> {
        let differences = WEIGHTED.iter().filter_map(|(with, without)| {
            Some((
                format!("{without} − {with}"),
                self.difference(without, with)?,
            ))
        });
        let text = "weighting by the MVE is no better than weighing all alike";
        self.not_above(text, differences.collect())
    }

    fn better_than_average(&self, method: &str) -> Option<Claim> {
        let difference = self.difference(method, AVERAGE)?;
        let verdict = ClaimVerdict::negative([&difference]);
        let (text, figures) = (
            format!("{method} is better than average"),
            format!("{difference:+.4}"),
        );
        Some(self.claim("beyond §V", &text, verdict, figures))
    }
}

/// Tests whether one pipeline is better than another in a range of bins, over the paper's methods.
fn is_better(
    analysis: &Analysis,
    methods: &[&str],
    label: &str,
    [better, worse]: [&str; 2],
) -> Option<Claim> {
    let group = analysis.group(label)?;
    let variant =
        |underlying, method| analysis.variant(&TrajectoryConfig::variant(underlying, method));
    let pairs = methods
        .iter()
        .filter_map(|m| Some((*m, variant(better, m)?, variant(worse, m)?)));
    let pairs: Vec<(&str, usize, usize)> = pairs.collect();
    pairs.first()?;
    let share = 1.0 / pairs.len() as f64;
    let terms = pairs
        .iter()
        .flat_map(|(_, a, b)| [(group, *a, share), (group, *b, -share)]);
    let together = analysis.contrast(Metric::Vsd, &terms.collect::<Vec<_>>())?;
    let mut figures = vec![format!("mean over the methods: {together:+.4}")];
    for (method, a, b) in &pairs {
        let difference = analysis.difference(Metric::Vsd, group, *a, *b)?;
        figures.push(format!("{method}: {difference:+.4}"));
    }
    let text = format!("{better} is better than {worse} at {label} initial VSD");
    Some(Claim::new(
        SECTION,
        text,
        ClaimVerdict::negative([&together]),
        listed(figures),
    ))
}
