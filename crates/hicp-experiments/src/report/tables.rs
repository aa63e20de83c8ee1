//! Fields and tables that all reports share.

use super::html::Table;
use crate::analysis::{Analysis, Interval, Metric};

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

/// Returns the mean VSD per variant and group.
pub(crate) fn means(analysis: &Analysis) -> Table {
    let groups = 0..analysis.groups().len();
    let mut table = Table::new(&["variant"]);
    table
        .head
        .extend(analysis.groups().iter().map(|group| group.label.clone()));
    let line = |name: &str, fields: Vec<String>| [vec![name.to_owned()], fields].concat();
    let initial = groups
        .clone()
        .map(|g| Some(fixed(Some(analysis.cell(g, 0)?.vsd_initial), 3)));
    if let Some(initial) = initial.collect() {
        table.rows.push(line("(initial)", initial));
    }
    for (variant, name) in analysis.variants().iter().enumerate() {
        let means = groups
            .clone()
            .map(|g| analysis.mean(Metric::Vsd, g, variant));
        let means = means.map(|i| i.map_or_else(String::new, |i| i.to_string()));
        table.rows.push(line(name, means.collect()));
    }
    table
}
