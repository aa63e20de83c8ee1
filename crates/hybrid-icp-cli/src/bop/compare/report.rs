//! The report of `bop compare`: tables for people, JSON for programs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::Context as _;
use hicp_experiments::{Table, html_escaped, html_page};
use serde::Serialize;

use crate::bop::eval::{Evaluation, Summary};
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
    pub(super) fn add(&mut self, name: &str, evaluation: Evaluation, seconds: Option<f64>) {
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
        let mut table = Table::new(&[
            "pipeline",
            "AR",
            "VSD",
            "MSSD",
            "MSPD",
            "median ADI mm",
            "improved %",
            "worsened %",
            "ms per pose",
            &format!("time / {first}"),
        ]);
        for entry in &self.entries {
            let all = &entry.all;
            let percent = |share: fn(&Changes) -> f64| entry.changes.map(|c| 100.0 * share(&c));
            let mut row = vec![entry.name.clone()];
            row.extend([all.ar, all.ar_vsd, all.ar_mssd, all.ar_mspd].map(|x| format!("{x:.3}")));
            row.push(number(all.median_adi_mm, 2));
            row.push(number(percent(|c| c.improved), 1));
            row.push(number(percent(|c| c.worsened), 1));
            row.push(number(entry.ms_per_pose, 2));
            row.push(number(entry.time_ratio, 2));
            table.rows.push(row);
        }
        table
    }

    /// Returns a figure by object and, in columns, by entry.
    fn by_object(&self, figure: impl Fn(&Summary) -> String) -> Table {
        let mut table = Table::new(&["object", "targets"]);
        let names = self.entries.iter().map(|entry| entry.name.clone());
        table.head.extend(names);
        let objects = self.entries.iter().flat_map(|entry| entry.objects.keys());
        for id in objects.collect::<BTreeSet<_>>() {
            let of_object = |entry: &Entry, figure: &dyn Fn(&Summary) -> String| {
                let summary = entry.objects.get(id);
                summary.map_or_else(|| "-".to_owned(), figure)
            };
            let targets = of_object(&self.entries[0], &|summary| summary.targets.to_string());
            let mut row = vec![id.to_string(), targets];
            row.extend(self.entries.iter().map(|entry| of_object(entry, &figure)));
            table.rows.push(row);
        }
        table
    }

    /// Names the compared files.
    fn subject(&self) -> String {
        let targets = self
            .entries
            .first()
            .map_or(0, |initial| initial.all.targets);
        format!(
            "{} in {}, split {}: {targets} targets",
            self.init, self.dataset, self.split
        )
    }

    /// Returns the tables by object, with their headings.
    fn objects(&self) -> [(&'static str, Table); 2] {
        let median = self.by_object(|s| number(s.median_adi_mm, 2));
        [
            ("AR by object", self.by_object(|s| format!("{:.3}", s.ar))),
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
