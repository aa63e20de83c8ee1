//! The tables of a report.

use crate::analysis::{Analysis, Interval, Metric};
use crate::claims::{Claim, TABLE_I};
use crate::html::Table;

fn number(value: Option<f64>, digits: usize) -> String {
    value
        .filter(|x| x.is_finite())
        .map_or_else(String::new, |x| format!("{x:.digits$}"))
}

/// Everything per group and variant, for programs.
pub(crate) fn summary(studies: &[(String, Analysis)]) -> Table {
    let mut table = Table::new(&[
        "study",
        "experiment",
        "group",
        "variant",
        "rows",
        "vsd_initial",
        "vsd_final",
        "vsd_final_low",
        "vsd_final_high",
        "failure_share",
        "failure_low",
        "failure_high",
        "worse_share",
        "worse_low",
        "worse_high",
        "add_median_mm",
        "add_below_tenth_diameter",
        "iterations",
        "cpu_ms",
        "cpu_ms_deviation",
        "cpu_ratio_to_nn_point_to_point",
    ]);
    for (name, analysis) in studies {
        let yardstick = analysis.variant("nn-point-to-point");
        for (group, described) in analysis.groups().iter().enumerate() {
            for (variant, variant_name) in analysis.variants().iter().enumerate() {
                let Some(cell) = analysis.cell(group, variant) else {
                    continue;
                };
                let vsd = analysis.mean(Metric::Vsd, group, variant);
                let failure = analysis.mean(Metric::Failure, group, variant);
                let worse = analysis.mean(Metric::Worse, group, variant);
                let time = |v| {
                    analysis
                        .mean(Metric::CpuMs, group, v)
                        .map(|i: Interval| i.estimate)
                };
                let ratio = yardstick.and_then(|y| Some(time(variant)? / time(y)?));
                table.rows.push(vec![
                    name.clone(),
                    analysis.experiment().name().to_owned(),
                    described.label.clone(),
                    variant_name.clone(),
                    cell.count.to_string(),
                    number(Some(cell.vsd_initial), 4),
                    number(vsd.map(|i| i.estimate), 4),
                    number(vsd.map(|i| i.low), 4),
                    number(vsd.map(|i| i.high), 4),
                    number(failure.map(|i| i.estimate), 4),
                    number(failure.map(|i| i.low), 4),
                    number(failure.map(|i| i.high), 4),
                    number(worse.map(|i| i.estimate), 4),
                    number(worse.map(|i| i.low), 4),
                    number(worse.map(|i| i.high), 4),
                    number(Some(cell.add_median_mm), 3),
                    number(Some(cell.add_success), 4),
                    number(Some(cell.iterations), 2),
                    number(time(variant), 3),
                    number(cell.cpu_deviation_ms, 3),
                    number(ratio, 3),
                ]);
            }
        }
    }
    table
}

/// The index of the variant that differences are taken from: hybrid, or the first.
fn reference(analysis: &Analysis) -> usize {
    analysis.variant("hybrid").unwrap_or(0)
}

/// Paired differences of hybrid against each other variant, per group.
pub(crate) fn differences(studies: &[(String, Analysis)]) -> Table {
    let mut table = Table::new(&[
        "study",
        "group",
        "variant",
        "against",
        "vsd_difference",
        "low",
        "high",
        "failure_difference",
        "failure_low",
        "failure_high",
    ]);
    for (name, analysis) in studies {
        let ours = reference(analysis);
        for (group, described) in analysis.groups().iter().enumerate() {
            for other in (0..analysis.variants().len()).filter(|v| *v != ours) {
                let of =
                    |metric| analysis.contrast(metric, &[(group, ours, 1.0), (group, other, -1.0)]);
                let (Some(vsd), Some(failure)) = (of(Metric::Vsd), of(Metric::Failure)) else {
                    continue;
                };
                let mut row = vec![
                    name.clone(),
                    described.label.clone(),
                    analysis.variants()[ours].clone(),
                    analysis.variants()[other].clone(),
                ];
                row.extend(
                    [vsd, failure]
                        .iter()
                        .flat_map(|i| [i.estimate, i.low, i.high])
                        .map(|x| number(Some(x), 4)),
                );
                table.rows.push(row);
            }
        }
    }
    table
}

/// The claims of all studies.
pub(crate) fn claims(claims: &[(String, Claim)]) -> Table {
    let mut table = Table::new(&["study", "where", "claim", "verdict", "figures"]);
    table.rows.extend(claims.iter().map(|(study, claim)| {
        vec![
            study.clone(),
            claim.section.to_owned(),
            claim.text.clone(),
            claim.verdict.name().to_owned(),
            claim.figures.clone(),
        ]
    }));
    table
}

/// Mean VSD per variant and group, one column per single group and one for all.
pub(crate) fn means(analysis: &Analysis) -> Table {
    let mut table = Table::new(&["variant"]);
    let groups: Vec<usize> = (0..analysis.groups().len()).collect();
    table
        .head
        .extend(groups.iter().map(|g| analysis.groups()[*g].label.clone()));
    if let Some(first) = groups
        .iter()
        .map(|g| analysis.cell(*g, 0))
        .collect::<Option<Vec<_>>>()
    {
        let initial = first.iter().map(|cell| number(Some(cell.vsd_initial), 3));
        table.rows.push(
            std::iter::once("(initial)".to_owned())
                .chain(initial)
                .collect(),
        );
    }
    for (variant, name) in analysis.variants().iter().enumerate() {
        let means = groups
            .iter()
            .map(|g| match analysis.mean(Metric::Vsd, *g, variant) {
                Some(i) => format!("{:.3} [{:.3}, {:.3}]", i.estimate, i.low, i.high),
                None => String::new(),
            });
        table
            .rows
            .push(std::iter::once(name.clone()).chain(means).collect());
    }
    table
}

/// Overall figures per variant, with the paper's times where it states one.
pub(crate) fn overall(analysis: &Analysis) -> Table {
    let mut table = Table::new(&[
        "variant",
        "rows",
        "mean VSD",
        "VSD > 0.3",
        "worse by > 0.02",
        "median ADD(-S), mm",
        "ADD(-S) < 0.1 d",
        "iterations",
        "CPU time, ms (± deviation)",
        "time / nn-point-to-point",
        "the paper's ratio",
        "hybrid − this, mean VSD",
    ]);
    let group = analysis.overall();
    let ours = reference(analysis);
    let yardstick = analysis.variant("nn-point-to-point");
    let paper = |name: &str| {
        TABLE_I
            .iter()
            .find(|(n, ..)| *n == name)
            .map(|(_, mean, _)| *mean)
    };
    for (variant, name) in analysis.variants().iter().enumerate() {
        let Some(cell) = analysis.cell(group, variant) else {
            continue;
        };
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let interval = |i: Interval| format!("{:.3} [{:.3}, {:.3}]", i.estimate, i.low, i.high);
        let time = |v| analysis.mean(Metric::CpuMs, group, v).map(|i| i.estimate);
        let spent = time(variant)
            .map(|mean| format!("{mean:.2} ± {:.2}", cell.cpu_deviation_ms.unwrap_or(0.0)));
        let share = |metric| {
            analysis.mean(metric, group, variant).map(|i| {
                format!(
                    "{} [{}, {}]",
                    percent(i.estimate),
                    percent(i.low),
                    percent(i.high)
                )
            })
        };
        let difference = (variant != ours)
            .then(|| analysis.contrast(Metric::Vsd, &[(group, ours, 1.0), (group, variant, -1.0)]))
            .flatten();
        let paper_ratio = paper(name)
            .zip(paper("nn-point-to-point"))
            .map(|(t, y)| t / y);
        table.rows.push(vec![
            name.clone(),
            cell.count.to_string(),
            analysis
                .mean(Metric::Vsd, group, variant)
                .map(interval)
                .unwrap_or_default(),
            share(Metric::Failure).unwrap_or_default(),
            share(Metric::Worse).unwrap_or_default(),
            number(Some(cell.add_median_mm), 2),
            percent(cell.add_success),
            number(Some(cell.iterations), 1),
            spent.unwrap_or_default(),
            number(yardstick.and_then(|y| Some(time(variant)? / time(y)?)), 2),
            number(paper_ratio, 2),
            difference.map(interval).unwrap_or_default(),
        ]);
    }
    table
}
