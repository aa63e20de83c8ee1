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
/// The output has the same rows in the same order. Rows that cannot be refined keep their numbers
/// and are counted by reason at the end. The time column has the seconds spent on all rows of the
/// image, added to the time in the input.
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
    /// The refined result file to write.
    #[arg(long, value_name = "OUT.csv")]
    output: PathBuf,
    /// Use the masks of a detections file (JSON with RLE segmentations) instead of mask_visib.
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
    /// Write -1 to the time column, so that the same input gives the same bytes.
    #[arg(long)]
    no_time: bool,
    #[command(flatten)]
    choice: RowOptions,
    /// Replace the score, so that poses can be ranked without ground truth. With mve, the score is
    /// 1 - MVE of the row's pose in the output, and 0 for a row without an MVE.
    #[arg(long, value_name = "BY", value_parser = ["mve"])]
    rescore: Option<String>,
    /// Also write the status of every row as CSV, with its MVE before and after, and the reasons
    /// not to trust its pose.
    #[arg(long, value_name = "ROWS.csv")]
    rows: Option<PathBuf>,
    /// Continue a killed run with the same options. If it left no journal, start from the
    /// beginning.
    #[arg(long)]
    resume: bool,
}

/// The kind of mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MaskKind {
    /// The visible masks of the ground truth (mask_visib).
    Visible,
    /// No segmentation: a row uses all depth inside the model's bounding box at its pose. The box
    /// is enlarged by a twentieth of the diameter. Use it with a projective pipeline, such as
    /// projective-cascade-plane-point.
    None,
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
    /// Checks that the outputs can be written and that they replace no input but the result file.
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

    /// Reads the rows to refine. Fails if a run in place would lose the other rows.
    fn read_rows(&self) -> anyhow::Result<Vec<ResultRow>> {
        let rows = limits().read_results(&self.results)?;
        let count = rows.len();
        let rows = self.choice.choose(rows, &self.results)?;
        if rows.len() < count && outputs::same_file(&self.output, &self.results) {
            bail!(
                "--output and --results both name {}, and {} leaves out {} of its {count} rows, which would be lost: expected different files",
                self.output.display(),
                self.choice.given().join(" with "),
                count - rows.len()
            );
        }
        Ok(rows)
    }
}
