//! What the presets that go beyond the paper aim at, held against a study.

use crate::analysis::{Analysis, FAULTY_MASK, Interval, Metric};
use crate::claims::{Claim, ClaimVerdict, all_negative, plain, signed};

/// What `local` may have of the mean VSD of `hybrid`, and how much longer it may take.
const LOCAL: (f64, f64) = (0.6, 1.2);
/// How much longer than `hybrid` `search` may take.
const SEARCH_TIME: f64 = 3.0;
/// The tenths of the initial VSD in which `local` is to be better: the bins below 0.8.
const BETTER_TENTHS: usize = 8;

/// Tests the aims; those whose variants the study lacks are left out.
pub(crate) fn aims(analysis: &Analysis) -> Vec<Claim> {
    let judge = Judge { analysis };
    let all = analysis.overall();
    let perfect = analysis.group("perfect").unwrap_or(all);
    let group = |label: &str| analysis.group(label).unwrap_or(all);
    let aims = [
        judge.share(
            Metric::Vsd,
            "local",
            perfect,
            LOCAL.0,
            "mean VSD, perfect images",
        ),
        judge.share(
            Metric::Vsd,
            "local",
            all,
            LOCAL.0,
            "mean VSD, all conditions",
        ),
        judge.better_in_bins(),
        judge.share(Metric::CpuMs, "local", all, LOCAL.1, "time, all conditions"),
        judge.below(
            Metric::Failure,
            "search",
            perfect,
            0.01,
            "fails, perfect images",
        ),
        judge.below(
            Metric::Failure,
            "search",
            group("depth-3"),
            0.03,
            "fails, 3 % depth noise",
        ),
        judge.below(
            Metric::Failure,
            "search",
            group(FAULTY_MASK),
            0.03,
            "fails, imperfect masks",
        ),
        judge.share(
            Metric::CpuMs,
            "search",
            all,
            SEARCH_TIME,
            "time, all conditions",
        ),
        judge.below(
            Metric::Worse,
            "local",
            all,
            0.01,
            "ends worse, all conditions",
        ),
        judge.below(
            Metric::Worse,
            "auto",
            all,
            0.01,
            "ends worse, all conditions",
        ),
    ];
    aims.into_iter().flatten().collect()
}

struct Judge<'a> {
    analysis: &'a Analysis,
}

impl Judge<'_> {
    /// "`name` has at most so much of what `hybrid` has."
    fn share(
        &self,
        metric: Metric,
        name: &str,
        group: usize,
        share: f64,
        what: &str,
    ) -> Option<Claim> {
        let (ours, hybrid) = (
            self.analysis.variant(name)?,
            self.analysis.variant("hybrid")?,
        );
        let excess = self
            .analysis
            .contrast(metric, &[(group, ours, 1.0), (group, hybrid, -share)])?;
        let mean = |v| self.analysis.mean(metric, group, v);
        let (a, b) = (mean(ours)?, mean(hybrid)?);
        Some(claim(
            format!("{name} has at most {share} × hybrid's: {what}"),
            all_negative([excess]),
            format!(
                "{:.2} ×: {} against {}",
                a.estimate / b.estimate,
                plain(&a),
                plain(&b)
            ),
        ))
    }

    /// "`name` does so in fewer than such a share of cases."
    fn below(
        &self,
        metric: Metric,
        name: &str,
        group: usize,
        limit: f64,
        what: &str,
    ) -> Option<Claim> {
        let found = self
            .analysis
            .mean(metric, group, self.analysis.variant(name)?)?;
        let excess = Interval {
            estimate: found.estimate - limit,
            low: found.low - limit,
            high: found.high - limit,
        };
        let percent = |x: f64| format!("{:.1} %", 100.0 * x);
        let reference = self.analysis.variant("hybrid");
        let reference = reference.and_then(|v| self.analysis.mean(metric, group, v));
        let reference =
            reference.map_or_else(String::new, |i| format!("; hybrid {}", percent(i.estimate)));
        Some(claim(
            format!("{name} below {}: {what}", percent(limit)),
            all_negative([excess]),
            format!(
                "{} [{}, {}]{reference}",
                percent(found.estimate),
                percent(found.low),
                percent(found.high)
            ),
        ))
    }

    /// "`local` is better in every bin below 0.8."
    fn better_in_bins(&self) -> Option<Claim> {
        let (local, hybrid) = (
            self.analysis.variant("local")?,
            self.analysis.variant("hybrid")?,
        );
        let bins = self.analysis.groups().iter().enumerate();
        let end = BETTER_TENTHS * self.analysis.n_bins();
        let below = |bins: &std::ops::Range<usize>| 10 * bins.end <= end;
        let bins = bins.filter(|(_, g)| g.single && g.bins.as_ref().is_some_and(below));
        let differences: Vec<(String, Interval)> = bins
            .filter_map(|(group, described)| {
                let terms = [(group, local, 1.0), (group, hybrid, -1.0)];
                let difference = self.analysis.contrast(Metric::Vsd, &terms)?;
                Some((described.label.clone(), difference))
            })
            .collect();
        if differences.is_empty() {
            return None;
        }
        let figures: Vec<String> = differences
            .iter()
            .map(|(label, i)| format!("{label}: {}", signed(i)))
            .collect();
        Some(claim(
            "local has a lower mean VSD than hybrid in every bin of the initial VSD below 0.8, perfect images".to_owned(),
            all_negative(differences.into_iter().map(|(_, i)| i)),
            figures.join("; "),
        ))
    }
}

fn claim(text: String, verdict: ClaimVerdict, figures: String) -> Claim {
    Claim {
        section: "aim",
        text,
        verdict,
        figures,
    }
}
