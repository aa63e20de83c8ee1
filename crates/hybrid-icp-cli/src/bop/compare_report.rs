//! What `bop compare` found: tables for people, JSON for programs.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Context as _;
use hicp_experiments::{Table, html_escaped, html_page};
use serde::Serialize;

use super::eval::Evaluation;
use super::eval_report::Summary;

/// The evaluation of a result file.
pub(crate) struct Entry {
    pub(crate) name: String,
    pub(crate) evaluation: Evaluation,
    /// Mean time of a pose on one thread; `None` where nothing was refined.
    pub(crate) seconds: Option<f64>,
}

/// Pipelines over one result file.
pub(crate) struct Comparison {
    pub(crate) dataset: String,
    pub(crate) split: String,
    pub(crate) init: String,
    pub(crate) initial: Entry,
    pub(crate) pipelines: Vec<Entry>,
}

/// Change of the ADI from which a pose counts as improved or worsened, metres.
const CHANGE: f64 = 1e-4;

/// An entry as JSON.
#[derive(Serialize)]
struct Record<'a> {
    name: &'a str,
    #[serde(flatten)]
    all: &'a Summary,
    /// Shares of the poses in both evaluations.
    #[serde(flatten)]
    changes: Option<Changes>,
    ms_per_pose: Option<f64>,
    /// Against the first pipeline.
    time_ratio: Option<f64>,
    objects: &'a BTreeMap<u32, Summary>,
}

#[derive(Serialize)]
struct Document<'a> {
    dataset: &'a str,
    split: &'a str,
    init: &'a str,
    entries: Vec<Record<'a>>,
}

/// Shares of the estimates in two evaluations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Changes {
    improved: f64,
    worsened: f64,
}

impl Comparison {
    fn entries(&self) -> impl Iterator<Item = &Entry> {
        std::iter::once(&self.initial).chain(&self.pipelines)
    }

    fn changes(&self, entry: &Entry) -> Option<Changes> {
        let is_initial = std::ptr::eq(entry, &self.initial);
        let before = &self.initial.evaluation.adi_m;
        (!is_initial).then(|| changes(before, &entry.evaluation.adi_m))
    }

    fn time_ratio(&self, entry: &Entry) -> Option<f64> {
        Some(entry.seconds? / self.pipelines.first()?.seconds?)
    }

    /// The recalls, errors and times of all.
    pub(crate) fn overall(&self) -> Table {
        let first = self.pipelines.first().map_or("", |entry| &entry.name);
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
        for entry in self.entries() {
            let all = &entry.evaluation.all;
            let changes = self.changes(entry);
            let mut row = vec![entry.name.clone()];
            row.extend([all.ar, all.ar_vsd, all.ar_mssd, all.ar_mspd].map(|x| format!("{x:.3}")));
            row.push(number(all.median_adi_mm, 2));
            row.push(number(changes.map(|c| 100.0 * c.improved), 1));
            row.push(number(changes.map(|c| 100.0 * c.worsened), 1));
            row.push(number(entry.seconds.map(|s| 1e3 * s), 2));
            row.push(number(self.time_ratio(entry), 2));
            table.rows.push(row);
        }
        table
    }

    /// A figure by object and, in columns, by entry.
    fn by_object(&self, figure: impl Fn(&Summary) -> String) -> Table {
        let mut table = Table::new(&["object", "targets"]);
        table.head.extend(self.entries().map(|e| e.name.clone()));
        let summaries = self.entries().flat_map(|e| &e.evaluation.objects);
        let objects: BTreeSet<u32> = summaries.map(|(id, _)| *id).collect();
        for id in objects {
            let of_object = |entry: &Entry, what: &dyn Fn(&Summary) -> String| {
                let summary = entry.evaluation.objects.get(&id);
                summary.map_or_else(|| "-".to_owned(), what)
            };
            let targets = of_object(&self.initial, &|summary| summary.targets.to_string());
            let mut row = vec![id.to_string(), targets];
            row.extend(self.entries().map(|entry| of_object(entry, &figure)));
            table.rows.push(row);
        }
        table
    }

    /// What was compared.
    fn subject(&self) -> String {
        format!(
            "{} in {}, split {}: {} targets",
            self.init, self.dataset, self.split, self.initial.evaluation.all.targets
        )
    }

    /// All tables, with their headings.
    fn tables(&self) -> [(&'static str, Table); 3] {
        [
            ("All objects", self.overall()),
            ("AR by object", self.by_object(|s| format!("{:.3}", s.ar))),
            (
                "Median ADI by object, mm",
                self.by_object(|s| number(s.median_adi_mm, 2)),
            ),
        ]
    }

    /// The comparison as Markdown; the table of all objects comes first.
    pub(crate) fn markdown(&self) -> String {
        let [(_, overall), others @ ..] = self.tables();
        let mut text = overall.markdown();
        text.push_str(&format!("\n{}. {EXPLAINED}\n", self.subject()));
        for (title, table) in others {
            text.push_str(&format!("\n{title}:\n\n{}", table.markdown()));
        }
        text
    }

    /// The comparison as one page.
    pub(crate) fn html(&self) -> String {
        let mut body = format!(
            "<p>{}</p>\n<p>{EXPLAINED}</p>\n",
            html_escaped(&self.subject())
        );
        for (title, table) in self.tables() {
            body.push_str(&format!("<h2>{title}</h2>\n{}", table.html()));
        }
        html_page("Pipelines compared", &body)
    }

    fn record<'a>(&self, entry: &'a Entry) -> Record<'a> {
        Record {
            name: &entry.name,
            all: &entry.evaluation.all,
            changes: self.changes(entry),
            ms_per_pose: entry.seconds.map(|s| 1e3 * s),
            time_ratio: self.time_ratio(entry),
            objects: &entry.evaluation.objects,
        }
    }

    /// The comparison as JSON.
    pub(crate) fn json(&self) -> anyhow::Result<String> {
        let document = Document {
            dataset: &self.dataset,
            split: &self.split,
            init: &self.init,
            entries: self.entries().map(|entry| self.record(entry)).collect(),
        };
        let text = serde_json::to_string_pretty(&document).context("cannot write JSON")?;
        Ok(text + "\n")
    }
}

const EXPLAINED: &str = "AR is the mean of the average recalls of VSD, MSSD and MSPD; ADI is that of the estimates matched to an \
    instance. A pose is improved or worsened when its ADI fell or rose by more than 0.1 mm. Times are of one thread, for mask, \
    normals and pipeline; compare their ratios.";

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |x| format!("{x:.digits$}"))
}

/// Shares of the estimates in both evaluations whose ADI fell and rose.
fn changes(before: &BTreeMap<usize, f64>, after: &BTreeMap<usize, f64>) -> Changes {
    let both = before
        .iter()
        .filter_map(|(row, a)| Some((*a, *after.get(row)?)));
    let changes: Vec<f64> = both.map(|(a, b)| b - a).collect();
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
