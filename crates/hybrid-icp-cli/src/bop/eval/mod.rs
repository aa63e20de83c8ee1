//! `hybrid-icp bop eval`.

mod calibration;
mod errors;
mod job;
mod report;

use std::path::PathBuf;

use clap::Args;

pub(crate) use self::job::{DELTA_MM, EvalJob};
pub(crate) use self::report::{Report, Summary};
use super::options::{DatasetOptions, ThreadOptions};
use crate::options::positive;
use crate::outputs::Files;

/// Compare a result file with the ground truth, as the BOP benchmark does.
///
/// The table has one row per object and one for all. Its columns are the average recalls of VSD,
/// MSSD and MSPD, their mean AR, the recall of AD below a tenth of the diameter, and the median
/// ADI. AD is ADI for symmetric objects and ADD for the others. The estimates of a target with the
/// best scores are matched greedily to its most visible instances. An instance without an estimate
/// counts as not found. The models come from models_eval/ of the dataset, or from models/ if it
/// does not exist.
///
/// The exit code is 0 even if warnings report targets and rows that do not match. It is 1 if
/// nothing could be evaluated or if a file is damaged; the rest is still reported.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    dataset: DatasetOptions,
    /// The result file: CSV with scene_id, im_id, obj_id, score, R, t and time.
    #[arg(long, value_name = "FILE.csv")]
    results: PathBuf,
    /// The file of targets; test_targets_bop19.json of the dataset if not given. Without both,
    /// every visible instance is a target.
    #[arg(long, value_name = "FILE.json")]
    targets: Option<PathBuf>,
    /// Ids of the objects whose AD is ADI; those with declared symmetries if not given.
    #[arg(long, value_name = "ID,…", value_delimiter = ',')]
    symmetric: Option<Vec<u32>>,
    /// Visibility tolerance of VSD in millimeters; the benchmark uses 5 for ITODD.
    #[arg(long, value_name = "MM", default_value_t = DELTA_MM, value_parser = positive)]
    delta: f64,
    /// Also write the recalls as JSON.
    #[arg(long, value_name = "FILE.json")]
    json: Option<PathBuf>,
    /// Also write the errors of every estimate against every instance of its target as CSV.
    #[arg(long, value_name = "FILE.csv")]
    errors: Option<PathBuf>,
    /// Also report whether the scores, from 0 to 1, rank correct rows first: the area under the ROC
    /// curve, and the share of correct rows by range of the score. A row is correct if its ADI is
    /// below a tenth of the diameter.
    #[arg(long)]
    calibration: bool,
    #[command(flatten)]
    threads: ThreadOptions,
}

const USAGE: &str = "\
hybrid-icp bop eval --dataset <DIR> [--split <NAME>]
           --results <FILE.csv> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop eval --dataset bop/ycbv --split test \\
      --results cosypose_ycbv-test.csv --errors errors.csv";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let files = Files::default()
        .reads("--results", [&arguments.results])
        .reads("--targets", &arguments.targets)
        .writes("--json", &arguments.json)
        .writes("--errors", &arguments.errors);
    files.check()?;
    files.spare_dataset(&arguments.dataset.root, &arguments.dataset.split)?;
    let job = EvalJob {
        dataset: &arguments.dataset,
        results: &arguments.results,
        targets: arguments.targets.as_deref(),
        symmetric: arguments.symmetric.as_deref(),
        delta_mm: arguments.delta,
        json: arguments.json.as_deref(),
        errors: arguments.errors.as_deref(),
        calibration: arguments.calibration,
        threads: arguments.threads,
    };
    job.run().map(|_| ())
}
