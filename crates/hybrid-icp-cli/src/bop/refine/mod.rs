//! `hybrid-icp bop refine`.

mod job;
mod journal;
mod row_options;
mod rows_file;
mod run;
mod settings;
mod summary;
mod warnings;

use std::path::PathBuf;

use anyhow::bail;
use clap::{Args, ValueEnum};
use hicp_bop::{BoxMask, MaskSource, Rescore};
use hicp_io::bop::ResultRow;

pub(crate) use self::job::RefineJob;
pub(crate) use self::row_options::RowOptions;
use super::options::{DatasetOptions, ThreadOptions};
use crate::choice::PipelineArguments;
use crate::limits::limits;
use crate::outputs::{self, Files, journal_of};

/// Refine every row of a result file.
///
/// The output has the same rows in the same order. A row is refined in one of its object's visible masks (mask_visib), or
/// in one of the segmentations of a detections file. It takes the mask that the silhouette at its pose overlaps most, but the
/// rows of one object in one image compete: each mask goes to one row, and the sum of the overlaps is as large as possible.
/// The remaining rows share the mask that they overlap most. No row takes a mask that it overlaps less than half as much as
/// another. Rows that cannot be refined keep their numbers and are counted by reason at the end. The time column holds the
/// seconds spent on all rows of the image, added to the time that the input states.
///
/// A journal next to the output (OUT.csv.journal) stores every image that is done. If a run is killed, --resume continues
/// with it. The output itself is written at the end, whole or not at all.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    dataset: DatasetOptions,
    /// The result file to refine: CSV with scene_id, im_id, obj_id, score, R, t and time.
    #[arg(long, value_name = "IN.csv")]
    results: PathBuf,
    /// Where the refined result file goes.
    #[arg(long, value_name = "OUT.csv")]
    output: PathBuf,
    /// Take the masks from a detections file (JSON with RLE segmentations) instead of mask_visib.
    #[arg(long, value_name = "FILE.json")]
    detections: Option<PathBuf>,
    /// The kind of mask.
    #[arg(
        long,
        value_enum,
        value_name = "WHAT",
        default_value_t = MaskKind::Visible,
        conflicts_with = "detections"
    )]
    mask: MaskKind,
    #[command(flatten)]
    pipeline: PipelineArguments,
    #[command(flatten)]
    threads: ThreadOptions,
    /// Write -1 into the time column, so that the same input gives the same bytes.
    #[arg(long)]
    no_time: bool,
    #[command(flatten)]
    choice: RowOptions,
    /// Write another score than that of the input, so that poses can be ranked without ground truth: with mve, 1 - MVE of the
    /// row's pose in the output, and 0 for a row without an MVE.
    #[arg(long, value_name = "BY", value_parser = ["mve"])]
    rescore: Option<String>,
    /// Write the status of every row of the output to a file: comma-separated, with its MVE before and after, and the reasons
    /// not to trust its pose.
    #[arg(long, value_name = "ROWS.csv")]
    rows: Option<PathBuf>,
    /// Continue a run of the same options that was killed; start from the beginning if it left no journal.
    #[arg(long)]
    resume: bool,
}

/// The kind of mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MaskKind {
    /// The visible masks of the ground truth (mask_visib).
    Visible,
    /// No segmentation: a row is refined in whatever was measured inside the model's bounding box at its pose, grown by a
    /// twentieth of the diameter. Best with a projective pipeline, such as projective-cascade-plane-point.
    None,
}

const USAGE: &str = "\
hybrid-icp bop refine --dataset <DIR> [--split <NAME>]
           --results <IN.csv> --output <OUT.csv> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop refine --dataset bop/ycbv --split test \\
      --results cosypose_ycbv-test.csv --output refined_ycbv-test.csv

Exit codes: 0 done, with the rows kept and the reasons in the summary; 1 a file
is damaged or no image was found (if that came up while refining, the output is
still written); 2 the command line is wrong; 130 interrupted (Ctrl-C or
SIGTERM), with the images that are done in the journal for --resume.";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.check_files()?;
    let pipeline = arguments.pipeline.choose()?;
    let rows = arguments.read_rows()?;
    let job = RefineJob {
        dataset: &arguments.dataset,
        results: &arguments.results,
        choice: arguments.choice.clone(),
        masks: match (&arguments.detections, arguments.mask) {
            (Some(path), _) => MaskSource::detections(limits().read_detections(path)?),
            (None, MaskKind::Visible) => MaskSource::Visible,
            (None, MaskKind::None) => MaskSource::Box(BoxMask::default()),
        },
        pipeline,
        output: &arguments.output,
        rows: arguments.rows.as_deref(),
        threads: arguments.threads,
        timed: !arguments.no_time,
        rescore: match arguments.rescore {
            Some(_) => Rescore::Mve,
            None => Rescore::Keep,
        },
        resume: arguments.resume,
        resumed_by: "--resume",
        listed_by: Some("--rows"),
    };
    job.run(rows).map(|_| ())
}

impl Arguments {
    /// Checks that the outputs can be written, and that they replace no other input than the result file.
    fn check_files(&self) -> anyhow::Result<()> {
        let journal = journal_of(&self.output);
        let files = Files::default()
            .reads("--results", [&self.results])
            .reads("--pipeline", self.pipeline.file())
            .reads("--detections", &self.detections)
            .reads("--targets", &self.choice.targets)
            .writes("--output", [&self.output])
            .writes("the journal of --output", &journal)
            .writes("--rows", &self.rows);
        files.check_in_place("--output", "--results")?;
        files.spare_dataset(&self.dataset.root, &self.dataset.split)
    }

    /// Reads the rows to refine. A run in place must not lose the others.
    fn read_rows(&self) -> anyhow::Result<Vec<ResultRow>> {
        let rows = limits().read_results(&self.results)?;
        let count = rows.len();
        let rows = self.choice.choose(rows, &self.results)?;
        if rows.len() < count && outputs::same_file(&self.output, &self.results) {
            bail!(
                "--output and --results both name {}, and {} leaves out {} of its {count} rows, expected different files: they would be lost",
                self.output.display(),
                self.choice.given().join(" with "),
                count - rows.len()
            );
        }
        Ok(rows)
    }
}
