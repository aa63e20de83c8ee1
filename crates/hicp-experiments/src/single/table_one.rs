//! Table I of the paper, and the claims about time.

use crate::analysis::{Interval, Metric};
use crate::claims::{Claim, ClaimVerdict, Judge};
use crate::study::ALL;

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

/// Returns the difference between the mean times of two variants, milliseconds.
fn time(judge: Judge<'_>, a: &str, b: &str) -> Option<Interval> {
    judge.contrast(Metric::CpuMs, &[(ALL, a, 1.0), (ALL, b, -1.0)])
}

/// Tests whether projective association is faster than everything else.
pub(super) fn projective_fastest(judge: Judge<'_>) -> Option<Claim> {
    let projective = judge.family("projective-");
    let mut slow = judge.family("");
    slow.retain(|name| !projective.contains(name));
    let pairs = projective
        .iter()
        .flat_map(|p| slow.iter().map(move |s| (p, s)));
    let contrasts: Vec<Interval> = pairs.filter_map(|(p, s)| time(judge, p, s)).collect();
    let by_estimate = |a: &&Interval, b: &&Interval| a.estimate.total_cmp(&b.estimate);
    let nearest = contrasts.iter().max_by(by_estimate)?;
    judge.claim(
        "every projective variant is faster than hybrid and than every variant with nearest neighbors",
        ClaimVerdict::strictly_negative(&contrasts),
        format!("the nearest pair differs by {nearest:+} ms"),
    )
}

/// Tests the order of the table.
pub(super) fn table_order(judge: Judge<'_>) -> Option<Claim> {
    let order = TABLE_I.map(|row| row.0);
    let pairs = order.windows(2).map(|pair| time(judge, pair[0], pair[1]));
    let pairs: Vec<Interval> = pairs.collect::<Option<_>>()?;
    let mean = |name| Some(judge.contrast(Metric::CpuMs, &[(ALL, name, 1.0)])?.estimate);
    let unit = mean(NN)?;
    let ratios = order
        .iter()
        .filter_map(|name| Some((mean(name)? / unit, *name)));
    let ratios: Vec<(f64, &str)> = ratios.collect();
    let not_faster = |(place, (ratio, _)): (usize, &(f64, &str))| {
        let later = ratios[place + 1..].iter();
        later.filter(|later| later.0 >= *ratio).count()
    };
    let agreeing: usize = ratios.iter().enumerate().map(not_faster).sum();
    let mut ranked = ratios.clone();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ranked = ranked
        .iter()
        .map(|(ratio, name)| format!("{name} {ratio:.2}"));
    let ranked = ranked.collect::<Vec<_>>().join(", ");
    judge.claim(
        "the order of Table I, every neighboring pair of it",
        ClaimVerdict::strictly_negative(&pairs),
        format!("{agreeing} of 36 pairs are in the paper's order; fastest first, time in units of {NN}: {ranked}"),
    )
}
