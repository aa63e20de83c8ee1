//! The refinement of a result file, for every command that needs one.

use std::path::{Path, PathBuf};

use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueEnum};
use hicp_bop::{MaskSource, Rescore};

use super::row_options::RowOptions;
use crate::bop::models::ModelOptions;
use crate::bop::options::{DatasetOptions, ThreadOptions};
use crate::choice::{Pipeline, PipelineArguments};
use crate::outputs::{Files, journal_of};

/// The options of the commands that write a result file.
#[derive(Debug, Args)]
pub(crate) struct JobOptions {
    /// The result file to write.
    #[arg(long, value_name = "OUT.csv")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pipeline: PipelineArguments,
    #[command(flatten)]
    pub(crate) models: ModelOptions,
    #[command(flatten)]
    threads: ThreadOptions,
    /// Write -1 to the time column, so that the same input gives the same bytes.
    #[arg(long)]
    no_time: bool,
    #[command(flatten)]
    pub(crate) choice: RowOptions,
    /// Replace the score, so that poses can be ranked without ground truth. With mve, the score is
    /// 1 - MVE of the row's pose in the output; with confidence, the probability that it is right.
    /// A row that was not refined has 0.
    #[arg(long, value_name = "BY", value_enum, hide_possible_values = true)]
    rescore: Option<RescoreBy>,
    /// Write up to K poses per row: its own, and at the end of the file the distinct other poses
    /// that a search found. The score of another pose is the lowest of the object's refined rows in
    /// the image, minus its gap in MVE. Without a search, there are none.
    #[arg(
        long,
        value_name = "K",
        default_value_t = 1,
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=1000)
    )]
    hypotheses: usize,
    /// Also write the status of every row as CSV, with its MVE before and after, its confidence,
    /// and the reasons not to trust its pose.
    #[arg(long, value_name = "ROWS.csv")]
    rows: Option<PathBuf>,
    /// Continue a killed run with the same options. If it left no journal, start from the
    /// beginning.
    #[arg(long)]
    resume: bool,
}

impl JobOptions {
    /// Adds the files that the job reads and writes to those of a command, and checks them.
    ///
    /// The output may replace the input of the option `replaceable`.
    pub(crate) fn check_files(
        &self,
        files: Files<'_>,
        replaceable: &str,
        dataset: &DatasetOptions,
    ) -> anyhow::Result<()> {
        let journal = journal_of(&self.output);
        let files = files
            .reads("--pipeline", self.pipeline.file())
            .reads("--targets", &self.choice.targets)
            .writes("--output", [&self.output])
            .writes("the journal of --output", &journal)
            .writes("--rows", &self.rows);
        files.check_in_place("--output", replaceable)?;
        files.spare_dataset(&dataset.root, &dataset.split)
    }

    /// Chooses the pipeline; by default, `color` if color images are used.
    ///
    /// If it `refines`, warns of color images that overrides leave unused. An estimate compares
    /// colors with every pipeline, and has no use for bounds.
    pub(crate) fn choose_pipeline(
        &self,
        dataset: &DatasetOptions,
        refines: bool,
    ) -> anyhow::Result<Pipeline> {
        let color = !self.models.no_color && dataset.has_color();
        if !refines {
            self.pipeline.check_bounds();
        } else if color {
            self.pipeline.check_overrides();
        }
        self.pipeline.choose(color)
    }

    /// Returns the job for the rows of a file.
    pub(crate) fn job<'a>(
        &'a self,
        dataset: &'a DatasetOptions,
        results: &'a Path,
        masks: MaskSource,
        pipeline: Pipeline,
    ) -> RefineJob<'a> {
        RefineJob {
            dataset,
            results,
            choice: self.choice.clone(),
            models: self.models.clone(),
            masks,
            pipeline,
            output: &self.output,
            rows: self.rows.as_deref(),
            threads: self.threads,
            timed: !self.no_time,
            rescore: match self.rescore {
                Some(RescoreBy::Mve) => Rescore::Mve,
                Some(RescoreBy::Confidence) => Rescore::Confidence,
                None => Rescore::Keep,
            },
            hypotheses: self.hypotheses,
            resume: self.resume,
            keeps_journal: false,
            resumed_by: "--resume",
            distrusts: true,
            listed_by: Some("--rows"),
        }
    }
}

/// The new score of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum RescoreBy {
    Mve,
    Confidence,
}

/// A refinement of the rows of a result file.
pub(crate) struct RefineJob<'a> {
    /// The dataset whose images the rows are refined in.
    pub(crate) dataset: &'a DatasetOptions,
    /// The result file, for messages.
    pub(crate) results: &'a Path,
    /// The options that chose the rows from the file.
    pub(crate) choice: RowOptions,
    pub(crate) models: ModelOptions,
    pub(crate) masks: MaskSource,
    pub(crate) pipeline: Pipeline,
    /// The path of the refined result file.
    pub(crate) output: &'a Path,
    /// The file for the status of every row.
    pub(crate) rows: Option<&'a Path>,
    pub(crate) threads: ThreadOptions,
    /// If `true`, writes times.
    pub(crate) timed: bool,
    pub(crate) rescore: Rescore,
    /// Number of rows per estimate, at least 1.
    pub(crate) hypotheses: usize,
    /// If `true`, continues an existing journal.
    pub(crate) resume: bool,
    /// If `true`, leaves the journal of a run that is done, so that its results can be read again.
    pub(crate) keeps_journal: bool,
    /// The option that continues an interrupted run, for messages.
    pub(crate) resumed_by: &'static str,
    /// If `true`, warns of poses that should not be trusted.
    pub(crate) distrusts: bool,
    /// The option that lists the status of every row, for messages.
    pub(crate) listed_by: Option<&'static str>,
}

impl RefineJob<'_> {
    /// Returns whether the rows have no poses, so that they are estimated.
    pub(super) fn estimates(&self) -> bool {
        matches!(self.masks, MaskSource::OfRows(_))
    }
}
