//! Table I of the paper, and the claims about time.

use crate::analysis::{Interval, Metric};
use crate::claims::{Claim, ClaimVerdict, Judge};

/// The order of Table I, fastest first: means and standard deviations of the times, seconds.
pub const TABLE_I: [(&str, f64, f64); 9] = [
    ("projective-point-to-plane", 0.061, 0.023),
    ("projective-point-to-point", 0.085, 0.038),
    ("projective-cascade-plane-point", 0.094, 0.035),
    ("projective-cascade-point-plane", 0.101, 0.040),
    ("nn-point-to-point", 0.401, 0.516),
    ("hybrid", 0.542, 0.436),
    ("nn-point-to-plane", 0.786, 3.535),
    ("nn-cascade-plane-point", 0.879, 3.713),
    ("nn-cascade-point-plane", 1.090, 3.869),
];

const NN: &str = "nn-point-to-point";

/// Returns the difference of the mean times of two variants.
fn time(judge: Judge<'_>, a: usize, b: usize) -> Option<Interval> {
    let all = judge.analysis.overall();
    judge.analysis.difference(Metric::CpuMs, all, a, b)
}

/// Tests that projective association is faster than everything else.
pub(super) fn projective_fastest(judge: Judge<'_>) -> Option<Claim> {
    let projective = judge.family("projective-");
    let mut slow = judge.family("");
    slow.retain(|v| !projective.contains(v));
    let pairs = projective
        .iter()
        .flat_map(|p| slow.iter().map(|s| (*p, *s)));
    let contrasts: Vec<Interval> = pairs.filter_map(|(p, s)| time(judge, p, s)).collect();
    let nearest = contrasts
        .iter()
        .max_by(|a, b| a.estimate.total_cmp(&b.estimate))?;
    judge.claim(
        "every projective variant is faster than hybrid and than every variant with nearest neighbours",
        ClaimVerdict::negative(&contrasts),
        format!("the nearest pair differs by {nearest:+} ms"),
    )
}

/// Tests the order of the table.
pub(super) fn table_order(judge: Judge<'_>) -> Option<Claim> {
    let all = judge.analysis.overall();
    let order = TABLE_I.iter().map(|row| judge.analysis.variant(row.0));
    let order: Vec<usize> = order.collect::<Option<_>>()?;
    let pairs = order.windows(2).map(|pair| time(judge, pair[0], pair[1]));
    let pairs: Vec<Interval> = pairs.collect::<Option<_>>()?;
    let mean = |v| Some(judge.analysis.mean(Metric::CpuMs, all, v)?.estimate);
    let unit = mean(judge.analysis.variant(NN)?)?;
    // The places in Table I and the ratios, fastest here first.
    let ratios = order.iter().filter_map(|v| Some((mean(*v)? / unit, *v)));
    let mut ranked: Vec<(usize, (f64, usize))> = ratios.enumerate().collect();
    ranked.sort_by(|a, b| a.1.0.total_cmp(&b.1.0));
    let later = |(i, one): (usize, &(usize, _))| {
        let others = ranked[i..].iter();
        others.filter(|later| later.0 > one.0).count()
    };
    let agreeing: usize = ranked.iter().enumerate().map(later).sum();
    let ranked = ranked
        .iter()
        .map(|(_, (ratio, v))| format!("{} {ratio:.2}", judge.name(*v)));
    let ranked = ranked.collect::<Vec<_>>().join(", ");
    judge.claim(
        "the order of Table I, every neighbouring pair of it",
        ClaimVerdict::negative(&pairs),
        format!("{agreeing} of 36 pairs are in the paper's order; fastest first, time in units of {NN}: {ranked}"),
    )
}
