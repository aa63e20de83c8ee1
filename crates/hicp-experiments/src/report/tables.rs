//! Fields and tables that all reports share.

use super::html::Table;
use crate::analysis::{Analysis, Cell, Interval, Metric};

/// Returns a number with a fixed number of digits, or an empty text if there is none.
pub(crate) fn fixed(value: Option<f64>, digits: usize) -> String {
    let value = value.filter(|x| x.is_finite());
    value.map_or_else(String::new, |x| format!("{x:.digits$}"))
}

/// Returns estimate, lower and upper end with four digits, or empty texts without an interval.
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

/// Returns count, initial VSD, and means with intervals of a variant in a group, for CSV files.
///
/// If there are no rows, returns `None`.
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

/// Returns the paired differences of two variants in a group with intervals, for CSV files.
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

/// Returns the mean VSD per variant, and per group that has rows.
pub(crate) fn means(analysis: &Analysis) -> Table {
    let groups = || 0..analysis.groups().len();
    let variants = || 0..analysis.variants().len();
    let mut table = Table::new(&["variant"]);
    let labels = analysis.groups().iter().map(|group| group.label.clone());
    table.head.extend(labels);
    let mut initial = vec!["(initial)".to_owned()];
    initial.extend(groups().map(|group| {
        let cell = variants().find_map(|variant| analysis.cell(group, variant));
        fixed(cell.map(|cell| cell.vsd_initial), 3)
    }));
    table.rows.push(initial);
    for variant in variants() {
        let mut row = vec![analysis.variants()[variant].clone()];
        let means = groups().map(|group| analysis.mean(Metric::Vsd, group, variant));
        row.extend(means.map(|i| i.map_or_else(String::new, |i| i.to_string())));
        table.rows.push(row);
    }
    table.without_empty_columns()
}
