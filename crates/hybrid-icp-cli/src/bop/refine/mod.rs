//! `hybrid-icp bop refine`.

mod job;
mod journal;
mod mask_options;
mod row_options;
mod rows_file;
mod run;
mod settings;
mod summary;
mod warnings;

use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use hicp_io::bop::ResultRow;

pub(crate) use self::job::{JobOptions, RefineJob};
pub(crate) use self::mask_options::MaskOptions;
pub(crate) use self::row_options::RowOptions;
use super::options::DatasetOptions;
use crate::limits::limits;
use crate::outputs::{self, Files};

/// Refine every row of a result file.
///
/// The output has the same rows in the same order. Rows that cannot be refined keep their poses
/// and are counted by reason at the end. The time column has the seconds spent on all rows of the
/// image, added to the time in the input. If that is unknown (-1), it is the time of the refinement
/// alone.
///
/// A row is refined in one of its object's visible masks (mask_visib), or in one of the
/// segmentations of a detections file. It uses the mask that the silhouette at its pose overlaps
/// most. The rows of one object in one image compete: each mask is assigned to one row, so that the
/// sum of the overlaps is as large as possible. The remaining rows share the mask that they overlap
/// most. No row uses a mask that it overlaps less than half as much as another mask.
///
/// A journal next to the output (OUT.csv.journal) stores the finished images. If a run is killed,
/// --resume continues it. The output itself is written at the end, completely or not at all.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    dataset: DatasetOptions,
    /// The result file to refine: CSV with scene_id, im_id, obj_id, score, R, t and time.
    #[arg(long, value_name = "IN.csv")]
    results: PathBuf,
    #[command(flatten)]
    masks: MaskOptions,
    #[command(flatten)]
    job: JobOptions,
}

const USAGE: &str = "\
hybrid-icp bop refine --dataset <DIR> [--split <NAME>]
           --results <IN.csv> --output <OUT.csv> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop refine --dataset bop/ycbv --split test \\
      --results cosypose_ycbv-test.csv --output refined_ycbv-test.csv

Exit codes: 0 done, and the summary counts the rows that were kept; 1 a file is
damaged or no image was found (if this is detected while refining, the output
is still written); 2 the command line is wrong; 130 interrupted (Ctrl-C or
SIGTERM), and the journal has the finished images for --resume.";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let Arguments {
        dataset, results, ..
    } = arguments;
    let files = Files::default()
        .reads("--results", [results])
        .reads("--detections", &arguments.masks.detections);
    arguments.job.check_files(files, "--results", dataset)?;
    let pipeline = arguments.job.choose_pipeline(dataset, true)?;
    let rows = arguments.read_rows()?;
    let masks = arguments.masks.source()?;
    let job = arguments.job.job(dataset, results, masks, pipeline);
    job.run(rows).map(|_| ())
}

impl Arguments {
    /// Reads the rows to refine. Fails if a run in place would lose the other rows.
    fn read_rows(&self) -> anyhow::Result<Vec<ResultRow>> {
        let rows = limits().read_results(&self.results)?;
        let count = rows.len();
        let rows = self.job.choice.choose(rows, &self.results)?;
        if rows.len() < count && outputs::same_file(&self.job.output, &self.results) {
            bail!(
                "--output and --results both name {}, and {} leaves out {} of its {count} rows, which would be lost: expected different files",
                self.job.output.display(),
                self.job.choice.given().join(" with "),
                count - rows.len()
            );
        }
        Ok(rows)
    }
}
