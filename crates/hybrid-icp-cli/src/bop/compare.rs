//! `hybrid-icp bop compare`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::Args;

use super::eval::{self, Evaluation};
use super::refine;
use crate::choice::{PipelineArguments, Source};
use crate::terminal::say;

/// Refine a result file with several pipelines, and compare them by their evaluations.
///
/// Writes, for every pipeline, its result file and its evaluation as JSON, and compare.md: average recalls, the median ADI,
/// the shares of the poses whose ADI fell and rose by more than 0.1 mm, and the time per pose on one thread of those given.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct Arguments {
    /// The dataset's folder, with models/ and the split's folder.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// The split's folder: test, test_primesense, train_pbr, …
    #[arg(long, value_name = "NAME", default_value = "test")]
    split: String,
    /// The result file to refine.
    #[arg(long, value_name = "FILE.csv")]
    init: PathBuf,
    /// The pipelines: names (`hybrid-icp pipelines` lists them) or TOML files.
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', required = true)]
    pipelines: Vec<Source>,
    /// The folder to write to; made when it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Threads; the number of cores if not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    threads: Option<u16>,
}

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop compare --dataset bop/ycbv --init cosypose_ycbv-test.csv \\
      --pipelines hybrid,nn-point-to-point --out compared";

/// What the initial poses are called.
const INITIAL: &str = "initial";
/// Change of the ADI from which a pose counts as improved or worsened, metres.
const CHANGE: f64 = 1e-4;

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut names = BTreeSet::from([INITIAL.to_owned()]);
    for pipeline in &arguments.pipelines {
        let name = pipeline.short_name();
        if !names.insert(name.clone()) {
            bail!(
                "--pipelines gives {name} twice, expected names that differ from each other and from {INITIAL}"
            );
        }
        // A file that cannot be built is told before anything is computed.
        PipelineArguments::plain(pipeline.clone()).choose()?;
    }
    let out = &arguments.out;
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot make the folder {}", out.display()))?;
    let dataset = (arguments.dataset.as_path(), arguments.split.as_str());
    let evaluate = |name: &str, results: &std::path::Path| {
        say(format_args!("\n{name}:"))?;
        let json = out.join(format!("{name}.json"));
        let words = eval::Arguments::plain(dataset, results, json, arguments.threads);
        eval::evaluate(&words)
    };
    let initial = evaluate(INITIAL, &arguments.init)?;
    let mut table = String::from(
        "| pipeline | AR | VSD | MSSD | MSPD | median ADI mm | improved % | worsened % | ms per pose |\n\
         |---|---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    table.push_str(&line(INITIAL, &initial, None, None));
    for pipeline in &arguments.pipelines {
        let name = pipeline.short_name();
        let output = out.join(format!("{name}.csv"));
        let seconds = refine::refine(&refine::Arguments::plain(
            dataset,
            PipelineArguments::plain(pipeline.clone()),
            (&arguments.init, output.clone()),
            arguments.threads,
        ))?;
        let refined = evaluate(&name, &output)?;
        table.push_str(&line(&name, &refined, Some(&initial), seconds));
    }
    let path = out.join("compare.md");
    hicp_io::write_atomically(&path, |writer| writer.write_all(table.as_bytes()))?;
    say(format_args!("\n{table}\n{}", path.display()))
}

/// A line of the table.
fn line(
    name: &str,
    found: &Evaluation,
    before: Option<&Evaluation>,
    seconds: Option<f64>,
) -> String {
    let all = &found.all;
    let dash = || "-".to_owned();
    let (improved, worsened) = before.map_or_else(
        || (dash(), dash()),
        |before| {
            let (improved, worsened) = changes(&before.adi_m, &found.adi_m);
            (
                format!("{:.1}", 100.0 * improved),
                format!("{:.1}", 100.0 * worsened),
            )
        },
    );
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "| {name} | {:.3} | {:.3} | {:.3} | {:.3} | {} | {improved} | {worsened} | {} |",
        all.ar,
        all.ar_vsd,
        all.ar_mssd,
        all.ar_mspd,
        all.median_adi_mm.map_or_else(dash, |mm| format!("{mm:.2}")),
        seconds.map_or_else(dash, |s| format!("{:.2}", 1e3 * s)),
    );
    text
}

/// Shares of the estimates in both evaluations whose ADI fell and rose.
fn changes(before: &BTreeMap<usize, f64>, after: &BTreeMap<usize, f64>) -> (f64, f64) {
    let both = before
        .iter()
        .filter_map(|(row, a)| Some((*a, *after.get(row)?)));
    let changes: Vec<f64> = both.map(|(a, b)| b - a).collect();
    let share = |changed: &dyn Fn(f64) -> bool| {
        let count = changes.iter().filter(|change| changed(**change)).count();
        count as f64 / changes.len().max(1) as f64
    };
    (
        share(&|change| change < -CHANGE),
        share(&|change| change > CHANGE),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_count_rows_of_both() {
        let before = BTreeMap::from([(0, 0.004), (1, 0.004), (2, 0.004), (3, 0.004), (9, 1.0)]);
        let after = BTreeMap::from([(0, 0.001), (1, 0.004_05), (2, 0.005), (3, 0.0), (7, 0.0)]);
        assert_eq!(changes(&before, &after), (0.5, 0.25));
        assert_eq!(changes(&before, &BTreeMap::new()), (0.0, 0.0));
    }
}
