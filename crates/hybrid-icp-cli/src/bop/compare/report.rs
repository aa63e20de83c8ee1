//! The report of `bop compare`: tables for people, JSON for programs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::Context as _;
use hicp_experiments::{Table, html_escaped, html_page};
use serde::Serialize;

use crate::bop::eval::{self, Summary};
use crate::bop::options::DatasetOptions;

/// Result files of one dataset: the initial one, and that of every pipeline.
#[derive(Serialize)]
pub(super) struct Comparison {
    dataset: String,
    split: String,
    init: String,
    entries: Vec<Entry>,
}

/// The evaluation of a result file.
#[derive(Serialize)]
struct Entry {
    name: String,
    #[serde(flatten)]
    all: Summary,
    #[serde(flatten)]
    changes: Option<Changes>,
    /// Mean time of a pose on one thread; `None` if nothing was refined.
    ms_per_pose: Option<f64>,
    /// Ratio to the time of the first pipeline.
    time_ratio: Option<f64>,
    objects: BTreeMap<u32, Summary>,
    #[serde(skip)]
    adi_m: BTreeMap<usize, f64>,
}

/// Shares of the estimates in two evaluations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Changes {
    improved: f64,
    worsened: f64,
}

/// A figure of a table; `None` if there is none.
type Figure<T> = fn(&T) -> Option<f64>;

/// Change of the ADI in meters from which a pose counts as improved or worsened.
const CHANGE: f64 = 1e-4;

const EXPLAINED: &str = "AR is the mean of the average recalls of VSD, MSSD and MSPD; ADI is that of the estimates matched to an \
    instance. A pose is improved or worsened when its ADI fell or rose by more than 0.1 mm. Times are of one thread, for mask, \
    normals and pipeline; compare their ratios.";

impl Comparison {
    /// Starts without entries.
    pub(super) fn new(dataset: &DatasetOptions, init: &Path) -> Self {
        Self {
            dataset: dataset.root.display().to_string(),
            split: dataset.split.clone(),
            init: init.display().to_string(),
            entries: Vec::new(),
        }
    }

    /// Adds an evaluation with the mean seconds per pose: the initial one first, then that of every pipeline.
    pub(super) fn add(&mut self, name: &str, evaluation: eval::Report, seconds: Option<f64>) {
        let ms_per_pose = seconds.map(|s| 1e3 * s);
        let first = self.entries.get(1).map_or(ms_per_pose, |e| e.ms_per_pose);
        let initial = self.entries.first();
        self.entries.push(Entry {
            name: name.to_owned(),
            changes: initial.map(|initial| changes(&initial.adi_m, &evaluation.adi_m)),
            ms_per_pose,
            time_ratio: ms_per_pose.zip(first).map(|(ms, first)| ms / first),
            all: evaluation.all,
            objects: evaluation.objects,
            adi_m: evaluation.adi_m,
        });
    }

    /// Returns the recalls, errors and times of all.
    pub(super) fn overall(&self) -> Table {
        let first = self.entries.get(1).map_or("", |entry| &entry.name);
        let ratio = format!("time / {first}");
        let columns: [(&str, usize, Figure<Entry>); 9] = [
            ("AR", 3, |e| Some(e.all.ar)),
            ("VSD", 3, |e| Some(e.all.ar_vsd)),
            ("MSSD", 3, |e| Some(e.all.ar_mssd)),
            ("MSPD", 3, |e| Some(e.all.ar_mspd)),
            ("median ADI mm", 2, |e| e.all.median_adi_mm),
            ("improved %", 1, |e| Some(100.0 * e.changes?.improved)),
            ("worsened %", 1, |e| Some(100.0 * e.changes?.worsened)),
            ("ms per pose", 2, |e| e.ms_per_pose),
            (&ratio, 2, |e| e.time_ratio),
        ];
        let mut table = Table::new(&["pipeline"]);
        table
            .head
            .extend(columns.iter().map(|(head, ..)| (*head).to_owned()));
        for entry in &self.entries {
            let mut row = vec![entry.name.clone()];
            row.extend(
                columns
                    .iter()
                    .map(|(_, digits, figure)| number(figure(entry), *digits)),
            );
            table.rows.push(row);
        }
        table
    }

    /// Returns a figure by object and, in columns, by entry.
    fn by_object(&self, digits: usize, figure: Figure<Summary>) -> Table {
        let mut table = Table::new(&["object", "targets"]);
        table
            .head
            .extend(self.entries.iter().map(|entry| entry.name.clone()));
        let objects = self.entries.iter().flat_map(|entry| entry.objects.keys());
        for id in objects.collect::<BTreeSet<_>>() {
            let mut summaries = self
                .entries
                .iter()
                .map(|entry| entry.objects.get(id))
                .peekable();
            let targets = summaries
                .peek()
                .copied()
                .flatten()
                .map(|s| s.targets.to_string());
            let mut row = vec![id.to_string(), targets.unwrap_or_else(|| "-".to_owned())];
            row.extend(summaries.map(|summary| number(summary.and_then(figure), digits)));
            table.rows.push(row);
        }
        table
    }

    /// Names the compared files.
    fn subject(&self) -> String {
        let targets = self.entries.first().map_or(0, |first| first.all.targets);
        format!(
            "{} in {}, split {}: {targets} targets",
            self.init, self.dataset, self.split
        )
    }

    /// Returns the tables by object, with their headings.
    fn objects(&self) -> [(&'static str, Table); 2] {
        let median = self.by_object(2, |summary| summary.median_adi_mm);
        [
            (
                "AR by object",
                self.by_object(3, |summary| Some(summary.ar)),
            ),
            ("Median ADI by object, mm", median),
        ]
    }

    /// Returns the comparison as Markdown; the table of all objects comes first.
    pub(super) fn markdown(&self) -> String {
        let overall = self.overall().markdown();
        let mut text = format!("{overall}\n{}. {EXPLAINED}\n", self.subject());
        for (title, table) in self.objects() {
            text.push_str(&format!("\n{title}:\n\n{}", table.markdown()));
        }
        text
    }

    /// Returns the comparison as one page.
    pub(super) fn html(&self) -> String {
        let subject = html_escaped(&self.subject());
        let mut body = format!("<p>{subject}</p>\n<p>{EXPLAINED}</p>\n");
        let overall = [("All objects", self.overall())];
        for (title, table) in overall.into_iter().chain(self.objects()) {
            body.push_str(&format!("<h2>{title}</h2>\n{}", table.html()));
        }
        html_page("Pipelines compared", &body)
    }

    /// Returns the comparison as JSON.
    pub(super) fn json(&self) -> anyhow::Result<String> {
        let text = serde_json::to_string_pretty(self).context("cannot write JSON")?;
        Ok(text + "\n")
    }
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |x| format!("{x:.digits$}"))
}

/// Returns the shares of the estimates in both evaluations whose ADI fell and rose.
fn changes(before: &BTreeMap<usize, f64>, after: &BTreeMap<usize, f64>) -> Changes {
    let both = before
        .iter()
        .filter_map(|(row, a)| Some(*after.get(row)? - a));
    let changes: Vec<f64> = both.collect();
    let share = |changed: &dyn Fn(f64) -> bool| {
        let count = changes.iter().filter(|change| changed(**change)).count();
        count as f64 / changes.len().max(1) as f64
    };
    Changes {
        improved: share(&|change| change < -CHANGE),
        worsened: share(&|change| change > CHANGE),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_count_rows_of_both() {
        let before = BTreeMap::from([(0, 0.004), (1, 0.004), (2, 0.004), (3, 0.004), (9, 1.0)]);
        let after = BTreeMap::from([(0, 0.001), (1, 0.004_05), (2, 0.005), (3, 0.0), (7, 0.0)]);
        let share = |improved, worsened| Changes { improved, worsened };
        assert_eq!(changes(&before, &after), share(0.5, 0.25));
        assert_eq!(changes(&before, &BTreeMap::new()), share(0.0, 0.0));
    }
}
