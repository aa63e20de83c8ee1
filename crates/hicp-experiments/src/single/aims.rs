//! The aims of the presets beyond the paper, tested.

use crate::analysis::Metric::{self, CpuMs, Failure, Vsd, Worse};
use crate::analysis::percent;
use crate::claims::{Claim, ClaimVerdict, Judge};
use crate::study::{ALL, FAULTY_MASK};

const HYBRID: &str = "hybrid";
/// `local` should be better than `hybrid` below this many tenths of the initial VSD.
const BETTER_TENTHS: usize = 8;

/// The limit of an aim.
#[derive(Clone, Copy)]
enum Limit {
    /// This factor times the figure of `hybrid`.
    Hybrid(f64),
    /// This share of the cases.
    Share(f64),
}

use Limit::{Hybrid, Share};

/// The aims: a preset, a group, and a figure that should be below a limit.
const AIMS: [(&str, &str, Metric, Limit); 9] = [
    ("local", "perfect", Vsd, Hybrid(0.6)),
    ("local", ALL, Vsd, Hybrid(0.6)),
    ("local", ALL, CpuMs, Hybrid(1.2)),
    ("search", "perfect", Failure, Share(0.01)),
    ("search", "depth-3", Failure, Share(0.03)),
    ("search", FAULTY_MASK, Failure, Share(0.03)),
    ("search", ALL, CpuMs, Hybrid(3.0)),
    ("local", ALL, Worse, Share(0.01)),
    ("auto", ALL, Worse, Share(0.01)),
];
/// The index of the aim for single bins among all aims.
const BINS_PLACE: usize = 2;

/// Tests the aims. An aim is `None` if the study lacks its variants.
pub(super) fn aims(judge: Judge<'_>) -> Vec<Option<Claim>> {
    let mut aims: Vec<Option<Claim>> = AIMS.iter().map(|aim| test(judge, *aim)).collect();
    aims.insert(BINS_PLACE, better_in_bins(judge));
    aims
}

fn test(
    judge: Judge<'_>,
    (name, group, metric, limit): (&str, &str, Metric, Limit),
) -> Option<Claim> {
    let images = match group {
        "perfect" => "perfect images",
        "depth-3" => "3 % depth noise",
        ALL => "all conditions",
        other => other,
    };
    let figure = match metric {
        Vsd => "mean VSD",
        Failure => "fails",
        CpuMs => "time",
        Worse => "ends worse",
    };
    let ours = judge.contrast(metric, &[(group, name, 1.0)])?;
    let hybrids = judge.contrast(metric, &[(group, HYBRID, 1.0)]);
    match limit {
        Hybrid(share) => {
            let terms = [(group, name, 1.0), (group, HYBRID, -share)];
            let (hybrids, excess) = (hybrids?, judge.contrast(metric, &terms)?);
            let ratio = ours.estimate / hybrids.estimate;
            judge.claim(
                format!("{name} has at most {share} × hybrid's: {figure}, {images}"),
                ClaimVerdict::strictly_negative(&[excess]),
                format!("{ratio:.2} ×: {ours} against {hybrids}"),
            )
        }
        Share(share) => {
            let hybrids = hybrids.map(|i| format!("; hybrid {}", percent(i.estimate)));
            let hybrids = hybrids.unwrap_or_default();
            judge.claim(
                format!("{name} below {}: {figure}, {images}", percent(share)),
                ClaimVerdict::strictly_negative(&[ours.minus(share)]),
                format!("{}{hybrids}", ours.percent()),
            )
        }
    }
}

/// Tests whether `local` is better in every bin below 0.8.
fn better_in_bins(judge: Judge<'_>) -> Option<Claim> {
    let end = BETTER_TENTHS * judge.analysis.n_bins();
    let groups = judge.analysis.groups().iter().filter(|group| group.single);
    let low = groups.filter(|g| g.bins.as_ref().is_some_and(|bins| 10 * bins.end <= end));
    let evidence = low.filter_map(|group| {
        let difference = judge.difference(&group.label, "local", HYBRID)?;
        Some((format!("{}: ", group.label), difference))
    });
    let text = "local has a lower mean VSD than hybrid in every bin of the initial VSD below 0.8, perfect images";
    judge.decide(text, ClaimVerdict::negative, evidence.collect())
}
