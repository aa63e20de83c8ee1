//! The report of studies of single images, with figures like the paper's Figure 6.

use std::collections::BTreeMap;

use super::claims::claims;
use super::config::Config;
use super::experiment::Experiment;
use super::table_one::TABLE_I;
use crate::analysis::{Analysis, Interval, Metric, percent};
use crate::claims::Claim;
use crate::report::{
    Curve, Document, Entry, Figure, Panel, Reported, Table, differences, figures, fixed,
    html_escaped, means, note_on_intervals, table, texts,
};

const YARDSTICK: &str = "nn-point-to-point";
/// The columns of `summary.csv`.
const SUMMARY: &str = "study|experiment|group|variant|rows|vsd_initial|vsd_final|vsd_final_low|\
    vsd_final_high|failure_share|failure_low|failure_high|worse_share|worse_low|worse_high|\
    add_median_mm|add_below_tenth_diameter|iterations|cpu_ms|cpu_ms_deviation|\
    cpu_ratio_to_nn_point_to_point";
/// The columns of `switches.csv`: the regimes of the outer iterations by their first letters, `a`
/// for aligned and `m` for misaligned, and the share of the cases that had them.
const SWITCHES: &str = "study|group|variant|regimes|cases|share|vsd_initial|vsd_final";
/// The columns of `differences.csv`.
const DIFFERENCES: &str = "study|group|variant|against|vsd_difference|low|high|\
    failure_difference|failure_low|failure_high";

impl Reported for Config {
    fn claims(&self, analysis: &Analysis) -> Vec<Claim> {
        claims(self.experiment, analysis)
    }

    fn described(&self) -> Vec<(&'static str, String)> {
        vec![
            ("experiment", self.experiment.name().to_owned()),
            ("version", self.version.clone()),
            ("cases per object", self.poses.to_string()),
        ]
    }

    fn document(entries: &[Entry<Self>]) -> Document {
        let figure = |alpha: bool| {
            let is_in = |e: &&Entry<Self>| (e.experiment() == Experiment::Alpha) == alpha;
            Figure::new(entries.iter().filter(is_in).map(Entry::panels).collect())
        };
        let paper_figure = "Mean VSD after ICP, as in Figure 6 of the paper";
        let note = format!(
            "Every variant refines the same images from the same initial poses. {} ADD(-S) is ADI if \
             an object declares symmetries. CPU time is the processor time of one thread from depth \
             image and mask to pose. It includes normals and search trees. Compare only its ratios.",
            note_on_intervals()
        );
        Document {
            title: "The single-image studies of Hybrid ICP, rerun",
            note,
            figures: vec![
                ("figure", paper_figure, figure(false)),
                ("alpha", "The threshold α", figure(true)),
            ],
            results: entries.iter().map(Entry::results).collect(),
            differences: table(entries, DIFFERENCES, Entry::differences),
            tables: vec![
                ("summary.csv", table(entries, SUMMARY, Entry::summary)),
                ("switches.csv", table(entries, SWITCHES, Entry::switches)),
            ],
        }
    }
}

impl Entry<Config> {
    fn experiment(&self) -> Experiment {
        self.study.config.experiment
    }

    /// Returns the index of the reference variant: `hybrid`, or else the first.
    fn reference(&self) -> usize {
        self.analysis.variant("hybrid").unwrap_or(0)
    }

    /// Returns the mean time of a variant in milliseconds, and its ratio to that of the yardstick.
    fn time(&self, group: usize, variant: usize) -> [Option<f64>; 2] {
        let mean = |v| Some(self.analysis.mean(Metric::CpuMs, group, v)?.estimate);
        let yardstick = self.analysis.variant(YARDSTICK).and_then(mean);
        let time = mean(variant);
        [time, time.zip(yardstick).map(|(time, unit)| time / unit)]
    }

    fn results(&self) -> String {
        format!(
            "<h2>{}</h2>\n<h3>All rows</h3>\n{}<h3>Mean VSD by group</h3>\n{}",
            html_escaped(&format!("{}: {}", self.name, self.experiment().title())),
            self.overall().html(),
            means(&self.analysis).html()
        )
    }

    /// Returns the overall figures per variant, with the paper's times.
    fn overall(&self) -> Table {
        let mut table = Table::headed(
            "variant|rows|mean VSD|VSD > 0.3|worse by > 0.02|median ADD(-S), mm|ADD(-S) < 0.1 d|iterations|\
             CPU time, ms (± deviation)|time / nn-point-to-point|the paper's ratio|hybrid − this, mean VSD",
        );
        let (analysis, group) = (&self.analysis, self.analysis.overall());
        let text = |interval: Option<Interval>| interval.map(|i| i.to_string()).unwrap_or_default();
        let paper = |name: &str| Some(TABLE_I.iter().find(|(n, ..)| *n == name)?.1);
        for (variant, name) in analysis.variants().iter().enumerate() {
            let Some(cell) = analysis.cell(group, variant) else {
                continue;
            };
            let share = |metric| {
                let mean = analysis.mean(metric, group, variant);
                mean.map(Interval::percent).unwrap_or_default()
            };
            let [time, ratio] = self.time(group, variant);
            let deviation = cell.cpu_deviation_ms.unwrap_or(0.0);
            let spent = time.map(|mean| format!("{mean:.2} ± {deviation:.2}"));
            let papers = paper(name).zip(paper(YARDSTICK));
            let ours = self.reference();
            let difference = analysis.difference(Metric::Vsd, group, ours, variant);
            table.rows.push(vec![
                name.clone(),
                cell.count.to_string(),
                text(analysis.mean(Metric::Vsd, group, variant)),
                share(Metric::Failure),
                share(Metric::Worse),
                fixed(Some(cell.add_median_mm), 2),
                percent(cell.add_success),
                fixed(Some(cell.steps), 1),
                spent.unwrap_or_default(),
                fixed(ratio, 2),
                fixed(papers.map(|(time, unit)| time / unit), 2),
                text(difference.filter(|_| ours != variant)),
            ]);
        }
        table.without_empty_columns()
    }

    /// Lays out the panels of a study like Figure 6 of the paper.
    ///
    /// The panels show nearest-neighbor variants, projective variants, and the other variants with
    /// the best of either. Studies of time have no panels.
    fn panels(&self) -> Vec<Panel> {
        let (analysis, experiment) = (&self.analysis, self.experiment());
        let x_title = match experiment {
            Experiment::InitNoise | Experiment::Beyond => "pre-ICP VSD",
            Experiment::DepthNoise => "depth noise, % of the depth",
            Experiment::ModelNoise => "model noise level",
            Experiment::Alpha => "α",
            Experiment::Timing => return Vec::new(),
        };
        let all: Vec<usize> = (0..analysis.variants().len()).collect();
        let is_of = |v: usize, family: &str| analysis.variants()[v].starts_with(family);
        type Indices = Vec<usize>;
        let (nearest, others): (Indices, Indices) = all.iter().partition(|v| is_of(**v, "nn-"));
        let (projective, mut last): (Indices, Indices) =
            others.iter().partition(|v| is_of(**v, "projective-"));
        let mean = |v: usize| {
            let mean = analysis.mean(Metric::Vsd, analysis.overall(), v);
            mean.map_or(f64::INFINITY, |i| i.estimate)
        };
        for family in [&nearest, &projective] {
            last.extend(family.iter().min_by(|a, b| mean(**a).total_cmp(&mean(**b))));
        }
        let panels = match experiment {
            Experiment::Alpha => vec![("mean VSD against the threshold", all)],
            Experiment::Beyond => vec![("perfect images", all)],
            _ => vec![
                ("nearest neighbors", nearest),
                ("projective", projective),
                ("hybrid and the best of either", last),
            ],
        };
        let panel = |(title, variants): (&str, Indices)| Panel {
            title: format!("{}: {title}", experiment.name()),
            x_title: x_title.to_owned(),
            y_title: "mean post-ICP VSD".to_owned(),
            curves: variants.iter().map(|v| Curve::of(analysis, *v)).collect(),
        };
        panels.into_iter().map(panel).collect()
    }

    /// Returns the rows of `summary.csv`: the figures of every variant in every group.
    fn summary(&self) -> Vec<Vec<String>> {
        let (analysis, experiment) = (&self.analysis, self.experiment().name());
        let metrics = [Metric::Vsd, Metric::Failure, Metric::Worse];
        let row = |(group, label, variant, name)| {
            let (cell, figures) = figures(analysis, &metrics, group, variant)?;
            let [time, ratio] = self.time(group, variant);
            let others = [
                fixed(Some(cell.add_median_mm), 3),
                fixed(Some(cell.add_success), 4),
                fixed(Some(cell.steps), 2),
                fixed(time, 3),
                fixed(cell.cpu_deviation_ms, 3),
                fixed(ratio, 3),
            ];
            let labels = texts(&[&self.name, experiment, label, name]);
            Some([&labels[..], &figures, &others].concat())
        };
        analysis.grid().filter_map(row).collect()
    }

    /// Returns the rows of `switches.csv`: how often each variant switched which way, per group.
    fn switches(&self) -> Vec<Vec<String>> {
        let mut rows = Vec::new();
        for (group, label, variant, name) in self.analysis.grid() {
            // Number, sum of the initial VSDs and sum of the final ones, by the regimes.
            let mut found: BTreeMap<&str, [f64; 3]> = BTreeMap::new();
            let figures = self.analysis.all_figures(group, variant);
            for measured in figures.filter(|m| !m.regimes.is_empty()) {
                let sums = found.entry(&measured.regimes).or_default();
                let figures = [1.0, measured.vsd_initial, measured.vsd_final];
                *sums = std::array::from_fn(|i| sums[i] + figures[i]);
            }
            let total: f64 = found.values().map(|sums| sums[0]).sum();
            rows.extend(found.into_iter().map(|(regimes, [count, initial, last])| {
                let labels = texts(&[&self.name, label, name, regimes, &format!("{count:.0}")]);
                let means = [count / total, initial / count, last / count];
                [labels, means.map(|x| fixed(Some(x), 4)).to_vec()].concat()
            }));
        }
        rows
    }

    /// Returns the paired differences between the reference and each other variant, per group.
    fn differences(&self) -> Vec<Vec<String>> {
        let (analysis, ours) = (&self.analysis, self.reference());
        let metrics = [Metric::Vsd, Metric::Failure];
        let row = |(group, label, other, name)| {
            let ends = differences(analysis, &metrics, group, [ours, other])?;
            let labels = texts(&[&self.name, label, &analysis.variants()[ours], name]);
            Some([labels, ends].concat())
        };
        let others = analysis.grid().filter(|cell| cell.2 != ours);
        others.filter_map(row).collect()
    }
}
