//! Fields and tables that all reports share.

use super::html::Table;
use crate::analysis::{Analysis, Cell, Interval, Metric};

/// Returns a number with fixed digits; empty if there is none.
pub(crate) fn fixed(value: Option<f64>, digits: usize) -> String {
    let value = value.filter(|x| x.is_finite());
    value.map_or_else(String::new, |x| format!("{x:.digits$}"))
}

/// Returns estimate, lower and upper end with four digits; empty if there is no interval.
pub(crate) fn ends(interval: Option<Interval>) -> [String; 3] {
    match interval {
        Some(interval) => interval.ends().map(|x| fixed(Some(x), 4)),
        None => Default::default(),
    }
}

/// Returns fields as text.
pub(crate) fn texts(fields: &[&str]) -> Vec<String> {
    fields.iter().map(|field| (*field).to_owned()).collect()
}

/// Returns the count, the initial VSD and some means with intervals of a variant in a group, for
/// programs; `None` if there is no row.
pub(crate) fn figures(
    analysis: &Analysis,
    metrics: &[Metric],
    group: usize,
    variant: usize,
) -> Option<(Cell, Vec<String>)> {
    let cell = analysis.cell(group, variant)?;
    let mut figures = vec![cell.count.to_string(), fixed(Some(cell.vsd_initial), 4)];
    let means = metrics
        .iter()
        .map(|metric| analysis.mean(*metric, group, variant));
    figures.extend(means.flat_map(ends));
    Some((cell, figures))
}

/// Returns the paired differences of two variants in a group with their intervals, for programs.
pub(crate) fn differences(
    analysis: &Analysis,
    metrics: &[Metric],
    group: usize,
    [a, b]: [usize; 2],
) -> Option<Vec<String>> {
    let found = metrics
        .iter()
        .map(|metric| analysis.difference(*metric, group, a, b));
    let found: Vec<Interval> = found.collect::<Option<_>>()?;
    Some(found.into_iter().flat_map(|i| ends(Some(i))).collect())
}

/// Returns the mean VSD per variant and group.
pub(crate) fn means(analysis: &Analysis) -> Table {
    let groups = || 0..analysis.groups().len();
    let mut table = Table::new(&["variant"]);
    let labels = analysis.groups().iter().map(|group| group.label.clone());
    table.head.extend(labels);
    let initial = |group| Some(fixed(Some(analysis.cell(group, 0)?.vsd_initial), 3));
    if let Some(initial) = groups().map(initial).collect::<Option<Vec<_>>>() {
        table.rows.push([texts(&["(initial)"]), initial].concat());
    }
    for (variant, name) in analysis.variants().iter().enumerate() {
        let mut row = vec![name.clone()];
        let means = groups().map(|group| analysis.mean(Metric::Vsd, group, variant));
        row.extend(means.map(|i| i.map_or_else(String::new, |i| i.to_string())));
        table.rows.push(row);
    }
    table
}
