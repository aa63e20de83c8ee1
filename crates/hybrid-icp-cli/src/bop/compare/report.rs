//! The report of `bop compare`: tables for people, JSON for programs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hicp_experiments::{Table, html_escaped, html_page};
use serde::Serialize;

use super::dots::dot_plot;
use super::interval::interval;
use super::worst::Worst;
use crate::bop::eval::{self, Summary};
use crate::bop::options::DatasetOptions;
use crate::options::file_name;

/// Result files of one dataset: the initial one, and that of every pipeline.
#[derive(Serialize)]
pub(super) struct Comparison {
    dataset: String,
    split: String,
    init: String,
    entries: Vec<Entry>,
    /// Says how many targets could not be evaluated, which are the same for all.
    pub(super) left_out: Option<String>,
    /// The names of the compared files, without their folders.
    #[serde(skip)]
    subject: String,
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
    /// 95 % interval of AR.
    ar_interval: Option<[f64; 2]>,
    /// AR minus that of the first pipeline, with its 95 % interval.
    ar_difference: Option<[f64; 3]>,
    objects: BTreeMap<u32, Summary>,
    #[serde(skip)]
    adi_m: BTreeMap<usize, f64>,
    #[serde(skip)]
    ar_by_image: Vec<(f64, usize)>,
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

/// Place of the first pipeline, after the initial poses and the baseline.
const FIRST: usize = 2;

/// Rows that the page has pictures of.
const N_WORST: usize = 3;

/// Signs of figures of which the highest, or the lowest, is the best.
const HIGHEST: f64 = 1.0;
const LOWEST: f64 = -1.0;

const EXPLAINED: &str = "AR is the mean of the average recalls of VSD, MSSD and MSPD; ADI is that of the estimates matched to an \
    instance. ADD is over objects that are not symmetric. The row ray-shift moves each initial pose along its viewing ray by the \
    median depth difference. A pose is improved or worsened when its ADI fell or rose by more than 0.1 mm. Times are of one thread, for mask, \
    normals, warnings, pipeline and confidence. They include what the first use of a model computes, which every pipeline does again. \
    Compare their ratios, from tens of rows per object. The 95 % intervals are those of the bootstrap over images. If that of the difference contains 0, \
    the order of the two pipelines is not certain. With few images, intervals are too narrow.";

impl Comparison {
    /// Starts without entries; `settings` continues the sentence about the compared files.
    pub(super) fn new(dataset: &DatasetOptions, init: &Path, settings: &str) -> Self {
        Self {
            dataset: dataset.root.display().to_string(),
            split: dataset.split.clone(),
            init: init.display().to_string(),
            entries: Vec::new(),
            left_out: None,
            subject: format!(
                "{} in {}, split {}{settings}",
                file_name(init),
                dataset.name(),
                dataset.split,
            ),
        }
    }

    /// Adds an evaluation with the mean seconds per pose: first that of the initial poses, then
    /// that of the baseline, then that of every pipeline.
    ///
    /// Ratios and differences are unknown until the first pipeline is added.
    pub(super) fn add(&mut self, name: &str, evaluation: eval::Report, seconds: Option<f64>) {
        let initial = self.entries.first();
        self.left_out = evaluation.left_out();
        self.entries.push(Entry {
            name: name.to_owned(),
            changes: initial.map(|initial| changes(&initial.adi_m, &evaluation.adi_m)),
            ms_per_pose: seconds.map(|s| 1e3 * s),
            time_ratio: None,
            ar_interval: interval(&evaluation.ar_by_image).map(|[_, low, high]| [low, high]),
            ar_difference: None,
            all: evaluation.all,
            objects: evaluation.objects,
            adi_m: evaluation.adi_m,
            ar_by_image: evaluation.ar_by_image,
        });
        let Some(first) = self.entries.get(FIRST) else {
            return;
        };
        let (ms, images) = (first.ms_per_pose, first.ar_by_image.clone());
        for (place, entry) in self.entries.iter_mut().enumerate() {
            entry.time_ratio = entry.ms_per_pose.zip(ms).map(|(own, first)| own / first);
            if place != FIRST && entry.ar_difference.is_none() {
                let pairs = entry.ar_by_image.iter().zip(&images);
                let gains = pairs.map(|(own, first)| (own.0 - first.0, own.1));
                entry.ar_difference = interval(&gains.collect::<Vec<_>>());
            }
        }
    }

    /// Returns the recalls, errors and times of all.
    pub(super) fn overall(&self) -> Table {
        let first = self.entries.get(FIRST).map_or("", |entry| &entry.name);
        let ratio = format!("time / {first}");
        let columns: [(&str, usize, f64, Figure<Entry>); 11] = [
            ("AR", 3, HIGHEST, |e| Some(e.all.ar)),
            ("VSD", 3, HIGHEST, |e| Some(e.all.ar_vsd)),
            ("MSSD", 3, HIGHEST, |e| Some(e.all.ar_mssd)),
            ("MSPD", 3, HIGHEST, |e| Some(e.all.ar_mspd)),
            ("median ADI mm", 2, LOWEST, |e| e.all.median_adi_mm),
            ("improved %", 1, HIGHEST, |e| {
                Some(100.0 * e.changes?.improved)
            }),
            ("worsened %", 1, LOWEST, |e| {
                Some(100.0 * e.changes?.worsened)
            }),
            ("ms per pose", 2, LOWEST, |e| e.ms_per_pose),
            (&ratio, 2, LOWEST, |e| e.time_ratio),
            ("MSSD<0.1d", 3, HIGHEST, |e| Some(e.all.mssd_recall)),
            ("ADD<0.1d", 3, HIGHEST, |e| e.all.add_recall),
        ];
        let mut table = Table::new(&["pipeline"]);
        let heads = columns.iter().map(|(head, ..)| (*head).to_owned());
        table.head.extend(heads);
        let intervals = ["AR, 95 %".to_owned(), format!("AR − {first}, 95 %")];
        table.head.extend(intervals);
        for entry in &self.entries {
            let figures = columns.iter();
            let figures = figures.map(|(_, digits, _, figure)| number(figure(entry), *digits));
            let name = std::iter::once(entry.name.clone());
            let ar = entry
                .ar_interval
                .map(|[low, high]| format!("{low:.3} to {high:.3}"));
            let gain = entry.ar_difference;
            let gain = gain.map(|[all, low, high]| format!("{all:+.3} ({low:+.3} to {high:+.3})"));
            let intervals = [ar, gain].map(|cell| cell.unwrap_or_else(|| "-".to_owned()));
            table
                .rows
                .push(name.chain(figures).chain(intervals).collect());
        }
        for (column, (_, _, sign, _)) in (1..).zip(&columns) {
            let cells = (0..table.rows.len()).map(|row| (row, column));
            mark_best(&mut table, *sign, cells);
        }
        table
    }

    /// Returns a figure by object and, in columns, by entry.
    fn by_object(&self, digits: usize, sign: f64, figure: Figure<Summary>) -> Table {
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
            let row = table.rows.len() - 1;
            let cells = (2..table.head.len()).map(|column| (row, column));
            mark_best(&mut table, sign, cells);
        }
        table
    }

    /// Names the compared files.
    fn subject(&self) -> String {
        let targets = self.entries.first().map_or(0, |first| first.all.targets);
        let left_out = self.left_out.iter();
        let left_out: String = left_out.map(|text| format!("; {text}")).collect();
        format!("{}: {targets} targets{left_out}", self.subject)
    }

    /// Returns the tables by object, with their headings.
    fn objects(&self) -> [(&'static str, Table); 2] {
        let ar = self.by_object(3, HIGHEST, |summary| Some(summary.ar));
        let median = self.by_object(2, LOWEST, |summary| summary.median_adi_mm);
        [("AR by object", ar), ("Median ADI by object, mm", median)]
    }

    /// Returns the rows with the largest ADI after any of the pipelines, each with that pipeline.
    pub(super) fn worst(&self) -> Vec<Worst> {
        let mut largest: BTreeMap<usize, (f64, &str)> = BTreeMap::new();
        for entry in self.entries.iter().skip(FIRST) {
            for (row, adi) in &entry.adi_m {
                let most = largest.entry(*row).or_insert((*adi, &entry.name));
                if *adi > most.0 {
                    *most = (*adi, &entry.name);
                }
            }
        }
        let mut rows: Vec<_> = largest.into_iter().collect();
        rows.sort_by(|(_, a), (_, b)| b.0.total_cmp(&a.0));
        let before = |row| self.entries.first()?.adi_m.get(row).copied();
        let worst = rows
            .iter()
            .take(N_WORST)
            .map(|(row, (adi, pipeline))| Worst {
                row: *row,
                pipeline: (*pipeline).to_owned(),
                adi_m: [before(row), Some(*adi)],
            });
        worst.collect()
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

    /// Returns the comparison as one page. `pictures` shows the worst rows, as HTML.
    pub(super) fn html(&self, pictures: &str) -> String {
        let subject = html_escaped(&self.subject());
        let values = |figure: Figure<Entry>| -> Vec<(&str, f64)> {
            let entries = self.entries.iter();
            entries
                .filter_map(|e| Some((&*e.name, figure(e)?)))
                .collect()
        };
        let ar = dot_plot("AR", &values(|e| Some(e.all.ar)), Some(1.0), 3);
        let adi = dot_plot("Median ADI, mm", &values(|e| e.all.median_adi_mm), None, 2);
        let mut body = format!("<p>{subject}</p>\n<div class=\"pictures\">\n{ar}{adi}</div>\n");
        let overall = [("All objects", self.overall())];
        for (title, table) in overall.into_iter().chain(self.objects()) {
            let table = table.html();
            body += &format!("<h2>{title}</h2>\n<figure class=\"numbers\">{table}</figure>\n");
        }
        body += &format!("<p>{EXPLAINED} The best figures are bold.</p>\n");
        if !pictures.is_empty() {
            body += "<h2>The largest ADI after a pipeline</h2>\n";
            body += &format!("<div class=\"pictures\">\n{pictures}</div>\n");
        }
        html_page("Pipelines compared", &body)
    }
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |x| format!("{x:.digits$}"))
}

/// Makes the best of some cells bold, by their printed figures, unless all are equal.
fn mark_best(table: &mut Table, sign: f64, cells: impl Iterator<Item = (usize, usize)>) {
    let figure = |&(row, column): &(usize, usize)| table.rows[row][column].parse::<f64>().ok();
    let figures = cells.filter_map(|cell| Some((sign * figure(&cell)?, cell)));
    let figures: Vec<_> = figures.collect();
    let best = figures
        .iter()
        .map(|(figure, _)| *figure)
        .fold(f64::NEG_INFINITY, f64::max);
    let (best, others): (Vec<_>, Vec<_>) = figures.into_iter().partition(|(f, _)| *f == best);
    if !others.is_empty() {
        table.bold.extend(best.into_iter().map(|(_, cell)| cell));
    }
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
