//! The paper's findings about fusing (§VI-C), tested.

use super::config::TrajectoryConfig;
use crate::analysis::{Analysis, Interval, Metric};
use crate::claims::{Claim, ClaimVerdict, EQUIVALENT_VSD, Evidence, Judge, listed};
use crate::study::{ALL, HIGH, LOW};

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

/// Tests the findings of the paper, and claims about the methods beyond it.
///
/// Claims about pipelines or methods that the study lacks are left out.
pub(super) fn claims(config: &TrajectoryConfig, analysis: &Analysis) -> Vec<Claim> {
    let (section, digits, methods) = ("§VI-C", 4, config.paper_methods());
    let judge = Judge {
        analysis,
        section,
        digits,
    };
    let mut found = Vec::new();
    for underlying in &config.underlying {
        let pipeline = Pipeline {
            judge,
            underlying: &underlying.name,
        };
        found.extend([
            pipeline.no_clear_best(&methods),
            pipeline.average_as_good(&methods),
            pipeline.weighting_no_better(),
        ]);
        found.extend(BEYOND.map(|method| pipeline.better_than_average(method)));
    }
    found.push(is_better(judge, &methods, LOW, [CASCADE, HYBRID]));
    found.push(is_better(judge, &methods, HIGH, [HYBRID, CASCADE]));
    found.into_iter().flatten().collect()
}

/// Tests claims about the methods with one underlying pipeline.
#[derive(Clone, Copy)]
struct Pipeline<'a> {
    judge: Judge<'a>,
    underlying: &'a str,
}

impl Pipeline<'_> {
    fn variant(self, method: &str) -> String {
        TrajectoryConfig::variant(self.underlying, method)
    }

    fn text(self, text: &str) -> String {
        format!("{}: {text}", self.underlying)
    }

    /// Returns the paired difference of the mean VSD of two methods over all bins.
    fn difference(self, a: &str, b: &str) -> Option<Interval> {
        self.judge
            .difference(ALL, &self.variant(a), &self.variant(b))
    }

    fn no_clear_best(self, methods: &[&str]) -> Option<Claim> {
        let mean = |method| Some(self.judge.vsd(ALL, &self.variant(method))?.estimate);
        let means = methods.iter().filter_map(|m| Some((mean(m)?, *m)));
        let mut ranked: Vec<(f64, &str)> = means.collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ((mean, best), others) = ranked.split_first()?;
        let against = others.iter();
        let against = against.filter_map(|(_, m)| Some((m, self.difference(best, m)?)));
        let against: Vec<_> = against.collect();
        against.first()?;
        let all: Vec<Interval> = against.iter().map(|(_, i)| *i).collect();
        let is_as_good = all.iter().any(|i| i.low > -EQUIVALENT_VSD);
        let verdict = match ClaimVerdict::negative(&all) {
            _ if is_as_good => ClaimVerdict::Holds,
            ClaimVerdict::Holds => ClaimVerdict::DoesNotHold,
            undecided => undecided,
        };
        let mut figures = vec![format!("lowest: {best}, {mean:.4}")];
        figures.extend(against.iter().map(|(m, i)| format!("− {m}: {i:+.4}")));
        let text = "no method is clearly best (lower than each other one, and equivalent to none)";
        self.judge.claim(self.text(text), verdict, listed(figures))
    }

    fn average_as_good(self, methods: &[&str]) -> Option<Claim> {
        let others = methods.iter().filter(|m| **m != AVERAGE);
        let evidence =
            others.filter_map(|m| Some((format!("− {m}: "), self.difference(AVERAGE, m)?)));
        let text = self.text("average is at least as good as each other method");
        self.judge
            .decide(text, ClaimVerdict::not_positive, evidence.collect())
    }

    fn weighting_no_better(self) -> Option<Claim> {
        let evidence = WEIGHTED.iter().filter_map(|(with, without)| {
            Some((
                format!("{without} − {with}: "),
                self.difference(without, with)?,
            ))
        });
        let text = self.text("weighting by the MVE is no better than weighing all alike");
        self.judge
            .decide(text, ClaimVerdict::not_positive, evidence.collect())
    }

    fn better_than_average(self, method: &str) -> Option<Claim> {
        let judge = Judge {
            section: "beyond §V",
            ..self.judge
        };
        let text = self.text(&format!("{method} is better than average"));
        judge.negative(text, self.difference(method, AVERAGE))
    }
}

/// Tests whether one pipeline is better than another in a range of bins, over the paper's methods.
fn is_better(
    judge: Judge<'_>,
    methods: &[&str],
    group: &str,
    [better, worse]: [&str; 2],
) -> Option<Claim> {
    let names = |m: &&str| [better, worse].map(|pipeline| TrajectoryConfig::variant(pipeline, m));
    let pairs = methods.iter().map(|m| (m, names(m)));
    let pairs =
        pairs.filter(|(_, names)| names.iter().all(|n| judge.analysis.variant(n).is_some()));
    let pairs: Vec<(&&str, [String; 2])> = pairs.collect();
    pairs.first()?;
    let share = 1.0 / pairs.len() as f64;
    let terms = pairs.iter();
    let terms = terms.flat_map(|(_, [a, b])| [(group, &**a, share), (group, &**b, -share)]);
    let together = judge.contrast(Metric::Vsd, &terms.collect::<Vec<_>>());
    let mut evidence: Evidence = vec![("mean over the methods: ".to_owned(), together?)];
    for (method, [a, b]) in &pairs {
        evidence.push((format!("{method}: "), judge.difference(group, a, b)?));
    }
    let text = format!("{better} is better than {worse} at {group} initial VSD");
    // Only the mean decides.
    judge.decide(text, |all| ClaimVerdict::negative(&all[..1]), evidence)
}
