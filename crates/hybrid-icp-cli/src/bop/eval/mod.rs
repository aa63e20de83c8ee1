//! `hybrid-icp bop eval`.

mod calibration;
mod errors;
mod job;
mod report;

use clap::Args;

pub(crate) use self::job::{DELTA_MM, EvalJob};
pub(crate) use self::report::{Report, Summary};
use crate::outputs::Files;

/// Compare a result file with the ground truth, as the BOP benchmark does.
///
/// The table has one row per object and one for all. Its columns are the average recalls of VSD,
/// MSSD and MSPD, their mean AR, the recall of ADD(-S) below a tenth of the diameter
/// (AD(D/I)<0.1d), and the median ADI. ADD(-S) is ADI for symmetric objects and ADD for the others.
/// The last two columns are the recalls of MSSD and ADD below a tenth of the diameter. `-` means
/// that there is no ADD, because the object is symmetric.
///
/// The estimates of a target with the best scores are matched greedily to its most visible
/// instances. An instance without an estimate counts as not found. The models come from
/// models_eval/ of the dataset, or from models/ if it does not exist.
///
/// The exit code is 0 even if warnings report targets and rows that do not match. It is 1 if
/// nothing could be evaluated or if a file is damaged; the rest is still reported.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    job: EvalJob,
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
    let job = &arguments.job;
    let files = Files::default()
        .reads("--results", [&job.results])
        .reads("--targets", &job.targets)
        .writes("--json", &job.json)
        .writes("--errors", &job.errors);
    files.check()?;
    files.spare_dataset(&job.dataset.root, &job.dataset.split)?;
    job.run().map(|_| ())
}
