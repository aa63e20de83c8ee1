//! `hybrid-icp bop compare`.

mod dots;
mod interval;
mod report;
mod worst;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_bop::Rescore;
use hicp_experiments::Table;

use self::report::Comparison;
use super::eval::{self, DELTA_MM, EvalJob};
use super::models::ModelOptions;
use super::options::{DatasetOptions, ThreadOptions};
use super::refine::{MaskOptions, RefineJob, RowOptions};
use crate::choice::{Pipeline, Source};
use crate::limits::limits;
use crate::outputs::{Files, journal_of, write_json};
use crate::terminal::{say, table};

/// Refine a result file with several pipelines, and compare them by their evaluations.
///
/// Writes the result file and the evaluation (JSON) of every pipeline. Writes the comparison as
/// compare.md, compare.html and compare.json: average recalls, success by MSSD and ADD, the median
/// ADI, the shares of the poses whose ADI fell and rose by more than 0.1 mm, and the time per pose
/// on one thread with its ratio to that of the first pipeline; AR and its difference from that of
/// the first pipeline, with 95 % intervals; AR and median ADI by object. The page also has pictures
/// of the three rows with the largest ADI after a pipeline. If a run is interrupted, the same
/// command continues it.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    dataset: DatasetOptions,
    /// The result file to refine.
    #[arg(long, value_name = "FILE.csv", visible_alias = "init")]
    results: PathBuf,
    /// The pipelines: names (`hybrid-icp pipelines` lists them) or TOML files.
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', required = true)]
    pipelines: Vec<Source>,
    /// Override a field, which every pipeline must have, such as milliseconds=30 of auto and color;
    /// may be given several times.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
    /// The folder to write to, which is created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The file of targets, as for `bop eval`. All rows are refined.
    #[arg(long, value_name = "FILE.json")]
    targets: Option<PathBuf>,
    #[command(flatten)]
    masks: MaskOptions,
    #[command(flatten)]
    models: ModelOptions,
    #[command(flatten)]
    threads: ThreadOptions,
}

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop compare --dataset bop/ycbv --results cosypose_ycbv-test.csv \\
      --pipelines hybrid,nn-point-to-point --out compared";

/// Name of the initial poses.
const INITIAL: &str = "initial";
/// Name of the first baseline of practitioners, and its stage in a pipeline file.
const BASELINE: &str = "ray-shift";
/// Name of the files of the comparison, and their endings.
const COMPARISON: &str = "compare";
const FORMS: [&str; 3] = ["md", "html", "json"];

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut names = BTreeSet::from([INITIAL, BASELINE, COMPARISON].map(str::to_owned));
    let baseline = Pipeline::parse(BASELINE, format!("type = {BASELINE:?}"), &[])?;
    let mut pipelines = vec![(BASELINE.to_owned(), baseline)];
    for source in &arguments.pipelines {
        let name = source.short_name();
        if !names.insert(name.clone()) {
            bail!(
                "--pipelines gives {name} twice, expected names that differ from each other, from {INITIAL}, {BASELINE} and {COMPARISON}"
            );
        }
        pipelines.push((name, source.choose(&arguments.overrides)?));
    }
    let out = &arguments.out;
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot make the folder {}", out.display()))?;
    arguments.check_files()?;
    let masks = arguments.masks.source()?;
    let overrides = arguments.overrides.iter().map(|set| format!(", {set}"));
    let settings = arguments.masks.label() + &overrides.collect::<String>();
    let mut comparison = Comparison::new(&arguments.dataset, &arguments.results, &settings);
    let initial = arguments.evaluate(INITIAL, &arguments.results)?;
    comparison.add(INITIAL, initial, None);
    let mut journals = Vec::new();
    for (name, pipeline) in pipelines {
        let output = out.join(format!("{name}.csv"));
        let job = RefineJob {
            dataset: &arguments.dataset,
            results: &arguments.results,
            choice: RowOptions::default(),
            models: arguments.models.clone(),
            masks: masks.clone(),
            pipeline,
            output: &output,
            rows: None,
            threads: arguments.threads,
            timed: true,
            rescore: Rescore::Keep,
            hypotheses: 1,
            resume: true,
            keeps_journal: true,
            resumed_by: "the same command",
            // Nobody expects the poses of the baseline to be right.
            distrusts: name != BASELINE,
            listed_by: None,
        };
        let seconds = job.run(limits().read_results(&arguments.results)?)?;
        comparison.add(&name, arguments.evaluate(&name, &output)?, seconds);
        journals.extend(journal_of(&output));
    }
    let results = |name: &str| out.join(format!("{name}.csv"));
    let worst = comparison.worst();
    let pictures = worst::pictures(&worst, &arguments.dataset, &arguments.results, results)?;
    let html = comparison.html(&pictures);
    let [markdown, page, json] = FORMS.map(|ending| out.join(format!("{COMPARISON}.{ending}")));
    for (path, text) in [(&markdown, comparison.markdown()), (&page, html)] {
        hicp_io::write_atomically(path, |writer| writer.write_all(text.as_bytes()))?;
    }
    write_json(&json, &comparison)?;
    // The comparison is done: nothing is left to continue.
    for journal in journals {
        std::fs::remove_file(&journal).with_context(|| journal.display().to_string())?;
    }
    let Table { head, rows, .. } = comparison.overall();
    let lines: Vec<_> = std::iter::once(head).chain(rows).collect();
    let left_out = comparison.left_out.iter();
    let left_out: String = left_out.map(|text| format!("\n{text}")).collect();
    say(format_args!(
        "{}{left_out}\n\n{} has the tables by object",
        table(&lines, 1),
        page.display()
    ))
}

impl Arguments {
    fn evaluate(&self, name: &str, results: &Path) -> anyhow::Result<eval::Report> {
        let json = self.out.join(format!("{name}.json"));
        let job = EvalJob {
            dataset: self.dataset.clone(),
            results: results.to_owned(),
            targets: self.targets.clone(),
            symmetric: None,
            delta_mm: DELTA_MM,
            json: Some(json),
            errors: None,
            calibration: false,
            threads: self.threads,
            quiet: true,
        };
        let report = job.run()?;
        say(format_args!("{name}: AR {:.3}\n", report.all.ar))?;
        Ok(report)
    }

    /// Checks that every file of the comparison can be written, and that none replaces an input.
    fn check_files(&self) -> anyhow::Result<()> {
        let names = self.pipelines.iter().map(Source::short_name);
        let names: Vec<String> = names.chain([BASELINE.to_owned()]).collect();
        let mut written: Vec<PathBuf> = Vec::new();
        written.extend(FORMS.map(|ending| self.out.join(format!("{COMPARISON}.{ending}"))));
        written.push(self.out.join(format!("{INITIAL}.json")));
        for name in names {
            let results = self.out.join(format!("{name}.csv"));
            written.extend(journal_of(&results));
            written.extend([results, self.out.join(format!("{name}.json"))]);
        }
        let files = Files::default()
            .reads("--results", [&self.results])
            .reads("--targets", &self.targets)
            .reads("--detections", &self.masks.detections)
            .reads(
                "--pipelines",
                self.pipelines.iter().filter_map(Source::file),
            )
            .writes("--out", &written);
        files.check()?;
        files.spare_dataset(&self.dataset.root, &self.dataset.split)
    }
}
