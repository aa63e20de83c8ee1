//! The aims of the presets beyond the paper, tested.

use crate::analysis::{Analysis, Interval, Metric};
use crate::claims::{Claim, ClaimVerdict, listed};
use crate::study::{ALL, FAULTY_MASK, Group};

const HYBRID: &str = "hybrid";
const LOCAL: &str = "local";
const PERFECT: &str = "perfect";
/// The tenths of the initial VSD in which `local` is to be better: the bins below 0.8.
const BETTER_TENTHS: usize = 8;

/// What a preset is to have less of.
#[derive(Clone, Copy)]
enum Aim {
    /// At most this share of what `hybrid` has.
    ShareOfHybrid(f64),
    /// Less than this share of the cases.
    Below(f64),
}

use Aim::{Below, ShareOfHybrid};

/// The aims: the preset, the group, the figure, the limit, and how the figure is called.
const AIMS: [(&str, &str, Metric, Aim, &str); 9] = [
    (
        LOCAL,
        PERFECT,
        Metric::Vsd,
        ShareOfHybrid(0.6),
        "mean VSD, perfect images",
    ),
    (
        LOCAL,
        ALL,
        Metric::Vsd,
        ShareOfHybrid(0.6),
        "mean VSD, all conditions",
    ),
    (
        LOCAL,
        ALL,
        Metric::CpuMs,
        ShareOfHybrid(1.2),
        "time, all conditions",
    ),
    (
        "search",
        PERFECT,
        Metric::Failure,
        Below(0.01),
        "fails, perfect images",
    ),
    (
        "search",
        "depth-3",
        Metric::Failure,
        Below(0.03),
        "fails, 3 % depth noise",
    ),
    (
        "search",
        FAULTY_MASK,
        Metric::Failure,
        Below(0.03),
        "fails, imperfect masks",
    ),
    (
        "search",
        ALL,
        Metric::CpuMs,
        ShareOfHybrid(3.0),
        "time, all conditions",
    ),
    (
        LOCAL,
        ALL,
        Metric::Worse,
        Below(0.01),
        "ends worse, all conditions",
    ),
    (
        "auto",
        ALL,
        Metric::Worse,
        Below(0.01),
        "ends worse, all conditions",
    ),
];
/// The place of the aim of each bin among the others.
const BINS_PLACE: usize = 2;

/// Tests the aims; those whose variants the study lacks are left out.
pub(super) fn aims(analysis: &Analysis) -> Vec<Claim> {
    let claim = |aim: &(&str, &str, Metric, Aim, &str)| {
        let (name, group, metric, aim, what) = *aim;
        let (variant, hybrid) = (analysis.variant(name)?, analysis.variant(HYBRID));
        let group = analysis.group(group).unwrap_or(analysis.overall());
        let mean = |variant| analysis.mean(metric, group, variant);
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let (text, excess, figures) = match aim {
            ShareOfHybrid(share) => {
                let terms = [(group, variant, 1.0), (group, hybrid?, -share)];
                let (ours, hybrids) = (mean(variant)?, mean(hybrid?)?);
                let ratio = ours.estimate / hybrids.estimate;
                (
                    format!("{name} has at most {share} × hybrid's: {what}"),
                    analysis.contrast(metric, &terms)?,
                    format!("{ratio:.2} ×: {ours} against {hybrids}"),
                )
            }
            Below(limit) => {
                let found = mean(variant)?;
                let [estimate, low, high] = found.ends().map(percent);
                let hybrids = hybrid.and_then(mean).map(|i| percent(i.estimate));
                let hybrids = hybrids.map_or_else(String::new, |share| format!("; hybrid {share}"));
                (
                    format!("{name} below {}: {what}", percent(limit)),
                    found.minus(limit),
                    format!("{estimate} [{low}, {high}]{hybrids}"),
                )
            }
        };
        Some(Claim::new(
            "aim",
            text,
            ClaimVerdict::negative([&excess]),
            figures,
        ))
    };
    let mut aims: Vec<Option<Claim>> = AIMS.iter().map(claim).collect();
    aims.insert(BINS_PLACE, better_in_bins(analysis));
    aims.into_iter().flatten().collect()
}

/// Tests that `local` is better in every bin below 0.8.
fn better_in_bins(analysis: &Analysis) -> Option<Claim> {
    let (local, hybrid) = (analysis.variant(LOCAL)?, analysis.variant(HYBRID)?);
    let end = BETTER_TENTHS * analysis.n_bins();
    let is_below = |group: &Group| {
        group.single && group.bins.as_ref().is_some_and(|bins| 10 * bins.end <= end)
    };
    let groups = analysis
        .groups()
        .iter()
        .enumerate()
        .filter(|(_, group)| is_below(group));
    let (labels, differences): (Vec<&str>, Vec<Interval>) = groups
        .filter_map(|(index, group)| {
            let difference = analysis.difference(Metric::Vsd, index, local, hybrid)?;
            Some((&*group.label, difference))
        })
        .unzip();
    differences.first()?;
    let figures = labels
        .iter()
        .zip(&differences)
        .map(|(label, i)| format!("{label}: {i:+}"));
    Some(Claim::new(
        "aim",
        "local has a lower mean VSD than hybrid in every bin of the initial VSD below 0.8, perfect images",
        ClaimVerdict::negative(&differences),
        listed(figures),
    ))
}
