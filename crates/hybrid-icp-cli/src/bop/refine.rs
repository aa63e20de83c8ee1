//! `hybrid-icp bop refine`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::bail;
use clap::{Args, ValueEnum};
use hicp_bop::{
    BoxMask, DatasetRefiner, FrameResult, FrameRows, MaskSource, Scenes, Shard, best_rows,
    frames_of,
};
use hicp_io::bop::{Dataset, ResultRow};
use rayon::prelude::*;

use super::journal::Journal;
use super::refine_summary::{Doubted, Told, mean_seconds, report_faults, warn_of_distrust};
use super::{
    models, progress_bar, refine_rows, refine_settings, refine_warnings, targets, thread_pool,
};
use crate::choice::{Pipeline, PipelineArguments};
use crate::limits::limits;
use crate::terminal::{say, warn};
use crate::{interrupt, outputs};

/// Refine every row of a result file.
///
/// The output has the same rows in the same order. A row is refined in one of its object's visible masks (mask_visib), or
/// of the segmentations of a detections file: in the one that the silhouette at its pose overlaps most, but the rows of one
/// object in one image compete, so that each mask goes to one of them and the sum of the overlaps is as large as can be.
/// Rows that are left over share the mask that they overlap most, and no row takes a mask that it overlaps less than half
/// as much. Rows that cannot be refined keep their numbers and are counted by reason at the end. The time column holds the
/// seconds spent on all rows of the image, added to the time that the input states.
///
/// While it runs, a journal beside the output (OUT.csv.journal) keeps every image that is done; --resume goes on from there
/// after a run was killed. The output itself is written at the end, whole or not at all.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    /// The dataset's folder, with models/ and the split's folder.
    #[arg(long, value_name = "DIR")]
    pub(super) dataset: PathBuf,
    /// The split's folder: test, test_primesense, train_pbr, …
    #[arg(long, value_name = "NAME", default_value = "test")]
    pub(super) split: String,
    /// The result file to refine: CSV with scene_id, im_id, obj_id, score, R, t and time.
    #[arg(long, value_name = "IN.csv")]
    results: PathBuf,
    /// Where the refined result file goes.
    #[arg(long, value_name = "OUT.csv")]
    output: PathBuf,
    /// Take the masks from a detections file (JSON with RLE segmentations) instead of mask_visib.
    #[arg(long, value_name = "FILE.json")]
    pub(super) detections: Option<PathBuf>,
    /// What masks are.
    #[arg(
        long,
        value_enum,
        value_name = "WHAT",
        default_value_t = MaskKind::Visible,
        conflicts_with = "detections"
    )]
    pub(super) mask: MaskKind,
    #[command(flatten)]
    pub(super) pipeline: PipelineArguments,
    /// Threads; the number of cores if not given. Nothing but the time column depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    threads: Option<u16>,
    /// Write -1 into the time column, so that the same input gives the same bytes.
    #[arg(long)]
    no_time: bool,
    /// Refine and write only part I of N, counted from 1. Images are never split; where the rows of each stand together,
    /// the outputs of all parts one after the other (each but the first without its header line) are that of one run.
    #[arg(long, value_name = "I/N", allow_hyphen_values = true)]
    pub(super) shard: Option<Shard>,
    /// Read only the first N rows of the result file; --top-k and --targets choose among these, --shard divides what is left.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub(super) limit: Option<u32>,
    /// Refine and write only the K rows with the best scores of every object in every image, the first of equals.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub(super) top_k: Option<u32>,
    /// Refine and write only rows of the targets of this file, of each the inst_count with the best scores: those that an
    /// evaluation looks at.
    #[arg(long, value_name = "FILE.json")]
    pub(super) targets: Option<PathBuf>,
    /// Write another score than that of the input, so that poses can be ranked without ground truth.
    #[arg(long, value_enum, value_name = "BY")]
    rescore: Option<Rescore>,
    /// Write what became of every row of the output to a file: comma-separated, with its MVE before and after, and why its pose is not to be
    /// trusted.
    #[arg(long, value_name = "ROWS.csv")]
    rows: Option<PathBuf>,
    /// Go on with a run of the same options that was killed; begin anew where it left no journal.
    #[arg(long)]
    resume: bool,
    /// Whether another command runs this one, which has none of its options.
    #[arg(skip)]
    called: bool,
}

/// What masks are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum MaskKind {
    /// The visible masks of the ground truth (mask_visib).
    Visible,
    /// No segmentation: a row is refined in whatever was measured inside the model's bounding box at its pose, grown by a
    /// twentieth of the diameter. Best with a projective pipeline, such as projective-cascade-plane-point.
    None,
}

/// What becomes the score.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Rescore {
    /// 1 - MVE of the row's pose in the output; 0 for a row without an MVE, because it met no mask, image or model.
    Mve,
}

const USAGE: &str = "\
hybrid-icp bop refine --dataset <DIR> [--split <NAME>]
           --results <IN.csv> --output <OUT.csv> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop refine --dataset bop/ycbv --split test \\
      --results cosypose_ycbv-test.csv --output refined_ycbv-test.csv

Exit codes: 0 done, with the rows kept and the reasons in the summary; 1 a file
is damaged or no frame was found (the output is still written where that came up
while refining); 2 the command line is wrong; 130 interrupted (Ctrl-C or
SIGTERM), with the frames that are done in the journal for --resume.";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    refine(arguments).map(|_| ())
}

/// Runs the command; returns the mean seconds per pose that was refined or kept by the pipeline, `None` without any.
pub(super) fn refine(arguments: &Arguments) -> anyhow::Result<Option<f64>> {
    arguments.check_files()?;
    let pipeline = arguments.pipeline.choose()?;
    let mut rows = arguments.read_rows()?;
    let dataset = Dataset::open(&arguments.dataset)?.with_limits(limits());
    dataset.scene_ids(&arguments.split)?;
    let masks = arguments.masks()?;
    let frames = frames_of(&rows);
    let pool = thread_pool(arguments.threads, frames.len())?;

    let start = Instant::now();
    let models_dir = dataset.models_dir()?;
    // Looked at before the files are read: what changes meanwhile is then another file for whoever goes on.
    let settings = refine_settings::of(arguments, &pipeline, &rows, &masks, &models_dir);
    let objects = rows.iter().map(|row| row.obj_id).collect();
    let models = pool.install(|| models::read(&models_dir, &objects))?;
    pool.install(|| refine_warnings::about_models(&models, &models_dir));
    let shared = DatasetRefiner {
        models,
        scenes: Scenes::new(&dataset, &arguments.split, pool.current_num_threads() + 1),
        masks,
    };
    let (journal, mut results) = arguments.journal(&settings, &frames)?;
    let resumed = results.iter().flatten().count();
    let ran = pool.install(|| {
        work(
            &shared,
            &pipeline,
            journal.as_ref(),
            (&rows, &frames),
            &mut results,
        )
    });
    if interrupt::asked() && ran.is_err() && journal.is_some() {
        bail!(
            "interrupted: {} of {} frames are done; {} goes on from there",
            results.iter().flatten().count(),
            frames.len(),
            if arguments.called {
                "the same command"
            } else {
                "--resume"
            }
        );
    }
    ran?;
    let results: Vec<FrameResult> = results.into_iter().flatten().collect();

    for result in &results {
        result.enter(&mut rows, arguments.rescore(), !arguments.no_time);
    }
    // The output comes last, for it may take the place of the input: until then a run that fails can go on.
    if let Some(path) = &arguments.rows {
        refine_rows::write(path, &rows, &results)?;
    }
    hicp_io::bop::write_results(&arguments.output, &rows)?;
    if let Some(journal) = journal {
        journal.remove()?;
    }

    let told = Told {
        output: &arguments.output,
        seconds: start.elapsed().as_secs_f64(),
        threads: pool.current_num_threads(),
        resumed,
    };
    // What is wrong is told on the other stream, whatever becomes of this one.
    let doubted = Doubted::of(&results);
    let said = say(told.summary(&results, &shared.models, &doubted));
    refine_warnings::about_images(&results, &rows);
    warn_of_distrust(&arguments.output, &doubted, &arguments.which());
    let images = arguments.dataset.join(&arguments.split);
    let files = (
        arguments.results.as_path(),
        arguments.output.as_path(),
        images.as_path(),
    );
    report_faults(files, (&shared.models, &models_dir), &results)?;
    said?;
    Ok(mean_seconds(&results))
}

/// Refines the images that have no result yet.
///
/// The threads take image after image in order, so that they are always in the same few scenes, and what is in memory is an
/// image per thread, whatever the dataset's size.
fn work(
    shared: &DatasetRefiner,
    pipeline: &Pipeline,
    journal: Option<&Journal>,
    (rows, frames): (&[ResultRow], &[FrameRows]),
    results: &mut [Option<FrameResult>],
) -> anyhow::Result<()> {
    let progress = progress_bar(rows.len(), "rows");
    interrupt::can_resume();
    let places = results.iter_mut().zip(frames).enumerate();
    let ran = places.par_bridge().try_for_each_init(
        || pipeline.refiner(),
        |refiner, (place, (result, (frame, indices)))| {
            if interrupt::asked() {
                bail!("interrupted");
            }
            if result.is_none() {
                let done = shared.frame(refiner, *frame, rows, indices);
                if let Some(journal) = journal {
                    journal.append(place, &done)?;
                }
                *result = Some(done);
            }
            progress.inc(indices.len() as u64);
            Ok::<(), anyhow::Error>(())
        },
    );
    progress.finish_and_clear();
    ran
}

impl Arguments {
    /// The command without options, but that it goes on with a run that was killed, as the command does that calls it.
    pub(super) fn plain(
        (dataset, split): (&Path, &str),
        pipeline: PipelineArguments,
        (results, output): (&Path, PathBuf),
        threads: Option<u16>,
    ) -> Self {
        Self {
            dataset: dataset.to_owned(),
            split: split.to_owned(),
            results: results.to_owned(),
            output,
            detections: None,
            mask: MaskKind::Visible,
            pipeline,
            threads,
            no_time: false,
            shard: None,
            limit: None,
            top_k: None,
            targets: None,
            rescore: None,
            rows: None,
            resume: true,
            called: true,
        }
    }

    /// Checks that the output can be written, and that it takes the place of no other input than the result file.
    fn check_files(&self) -> anyhow::Result<()> {
        let mut inputs = vec![("--results", self.results.as_path())];
        let others = [
            ("--pipeline", self.pipeline.file()),
            ("--detections", self.detections.as_ref()),
            ("--targets", self.targets.as_ref()),
        ];
        let others = others.into_iter();
        inputs.extend(others.filter_map(|(option, path)| Some((option, path?.as_path()))));
        let journal = self.journal_path();
        let mut written = vec![("--output", self.output.as_path())];
        written.extend(journal.as_deref().map(|p| ("the journal of --output", p)));
        written.extend(self.rows.as_deref().map(|p| ("--rows", p)));
        outputs::check(&written, &inputs, &[("--output", "--results")])?;
        // What is refined in place is a result file wherever it is, and what is no journal is refused as one.
        written.retain(|(option, _)| match *option {
            "--output" => !self.is_in_place(),
            option => option == "--rows",
        });
        outputs::check_dataset(&written, (&self.dataset, &self.split))
    }

    /// Whether the output takes the place of the result file.
    fn is_in_place(&self) -> bool {
        outputs::same_file(&self.output, &self.results)
    }

    /// Where the journal is. There is none for what is not a file, or is the file of an open descriptor.
    fn journal_path(&self) -> Option<PathBuf> {
        (!hicp_io::is_stream(&self.output)).then(|| Journal::path_of(&self.output))
    }

    /// Reads the rows that are to be refined and written.
    fn read_rows(&self) -> anyhow::Result<Vec<ResultRow>> {
        let rows = limits().read_results(&self.results)?;
        let count = rows.len();
        let rows = self.choose_rows(rows)?;
        if rows.len() < count && self.is_in_place() {
            bail!(
                "--output and --results both name {}, and {} leaves out {} of its {count} rows, expected different files: they would be lost",
                self.output.display(),
                self.leaving_out().join(" with "),
                count - rows.len()
            );
        }
        Ok(rows)
    }

    /// The options given that may leave rows out.
    fn leaving_out(&self) -> Vec<&'static str> {
        let options = [
            ("--limit", self.limit.is_some()),
            ("--top-k", self.top_k.is_some()),
            ("--targets", self.targets.is_some()),
            ("--shard", self.shard.is_some()),
        ];
        let given = options.into_iter().filter(|(_, is_given)| *is_given);
        given.map(|(option, _)| option).collect()
    }

    fn choose_rows(&self, mut rows: Vec<ResultRow>) -> anyhow::Result<Vec<ResultRow>> {
        if let Some(limit) = self.limit {
            rows.truncate(limit as usize);
        }
        let targets = match &self.targets {
            Some(path) => Some(targets::read(path)?),
            None => None,
        };
        let top = self.top_k.map(|top| top as usize);
        let rows = best_rows(rows, top, targets.as_ref());
        let Some(shard) = self.shard else {
            return Ok(rows);
        };
        let part = shard.take(rows);
        if !part.contiguous {
            warn(format_args!(
                "{}: the rows of an image do not stand together, so that the outputs of all shards one after the other have another order than one run",
                self.results.display()
            ));
        }
        Ok(part.rows)
    }

    /// What tells which rows are meant, in brackets, or nothing.
    fn which(&self) -> String {
        match &self.rows {
            Some(path) => format!(" ({} tells which)", path.display()),
            None if self.called => String::new(),
            None => " (--rows tells which)".to_owned(),
        }
    }

    fn masks(&self) -> anyhow::Result<MaskSource> {
        Ok(match (&self.detections, self.mask) {
            (Some(path), _) => MaskSource::detections(limits().read_detections(path)?),
            (None, MaskKind::Visible) => MaskSource::Visible,
            (None, MaskKind::None) => MaskSource::Box(BoxMask::default()),
        })
    }

    fn rescore(&self) -> hicp_bop::Rescore {
        match self.rescore {
            Some(Rescore::Mve) => hicp_bop::Rescore::Mve,
            None => hicp_bop::Rescore::Keep,
        }
    }

    /// Opens the journal, where there is to be one, and returns it with what it holds of the frames.
    fn journal(
        &self,
        settings: &[refine_settings::Setting],
        frames: &[FrameRows],
    ) -> anyhow::Result<(Option<Journal>, Vec<Option<FrameResult>>)> {
        let mut results: Vec<Option<FrameResult>> = frames.iter().map(|_| None).collect();
        let Some(path) = self.journal_path() else {
            return Ok((None, results));
        };
        let (journal, done) = Journal::open(path, settings, self.resume)?;
        for (place, result) in done {
            let indices = frames.get(place).map_or(&[][..], |(_, indices)| indices);
            let found = result.rows.iter().map(|row| row.index);
            // Anything else was not written by this program.
            if found.eq(indices.iter().copied()) && !indices.is_empty() {
                results[place] = Some(result);
            }
        }
        Ok((Some(journal), results))
    }
}
