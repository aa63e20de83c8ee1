//! `hybrid-icp bop refine`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Write as _};
use std::hash::{DefaultHasher, Hasher};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::bail;
use clap::{Args, ValueEnum};
use hicp_io::bop::{Dataset, Detection, ResultRow};
use hybrid_icp::{Isometry3, Refiner, Verdict};
use rayon::prelude::*;

use super::frame::{Fate, Frame};
use super::images::Scenes;
use super::journal::Journal;
use super::models::Models;
use super::problem::{self, Problem};
use super::shard::Shard;
use super::{median, progress_bar, thread_pool};
use crate::choice::{Pipeline, PipelineArguments};
use crate::limits::limits;
use crate::terminal::{say, warn};
use crate::{interrupt, outputs, report};

/// Refine every row of a result file.
///
/// The output has the same rows in the same order. The mask of a row is the visible mask (mask_visib) of the same object
/// that the silhouette at the row's pose overlaps most, or one of a detections file. Rows that cannot be refined keep their
/// numbers and are counted by reason at the end. The time column holds the seconds spent on all rows of the image, added to
/// the time that the input states.
///
/// While it runs, a journal beside the output (OUT.csv.journal) keeps every image that is done; --resume goes on from there
/// after a run was killed. The output itself is written at the end, whole or not at all.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    /// The dataset's folder, with models/ and the split's folder.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// The split's folder: test, test_primesense, train_pbr, …
    #[arg(long, value_name = "NAME", default_value = "test")]
    split: String,
    /// The result file to refine: CSV with scene_id, im_id, obj_id, score, R, t and time.
    #[arg(long, value_name = "IN.csv")]
    results: PathBuf,
    /// Where the refined result file goes.
    #[arg(long, value_name = "OUT.csv")]
    output: PathBuf,
    /// Take the masks from a detections file (JSON with RLE segmentations) instead of mask_visib.
    #[arg(long, value_name = "FILE.json")]
    detections: Option<PathBuf>,
    #[command(flatten)]
    pipeline: PipelineArguments,
    /// Threads; the number of cores if not given. Nothing but the time column depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    threads: Option<u16>,
    /// Write -1 into the time column, so that the same input gives the same bytes.
    #[arg(long)]
    no_time: bool,
    /// Refine and write only part I of N, counted from 1. Images are never split; where the rows of each stand together,
    /// the outputs of all parts one after the other (each but the first without its header line) are that of one run.
    #[arg(long, value_name = "I/N", allow_hyphen_values = true)]
    shard: Option<Shard>,
    /// Read only the first N rows of the result file; --shard divides these.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    limit: Option<u32>,
    /// Write another score than that of the input, so that poses can be ranked without ground truth.
    #[arg(long, value_enum, value_name = "BY")]
    rescore: Option<Rescore>,
    /// Go on with a run of the same options that was killed; begin anew where it left no journal.
    #[arg(long)]
    resume: bool,
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

/// A row's result.
#[derive(Debug)]
pub(super) struct Refined {
    /// Its place among the rows of the run.
    pub(super) index: usize,
    pub(super) fate: Fate,
    /// The pose, where it is another than the row's.
    pub(super) pose: Option<Isometry3<f64>>,
    /// MVE of the row's pose and of the result's.
    pub(super) mve: Option<(f64, f64)>,
}

/// All rows of a frame.
#[derive(Debug)]
pub(super) struct FrameResult {
    pub(super) rows: Vec<Refined>,
    /// Spent on its rows; `None` if none got as far as the pipeline.
    pub(super) seconds: Option<f64>,
    pub(super) problems: Vec<Problem>,
}

/// Rows of a frame: scene, image and where the rows stand in the file.
type FrameRows = ((u32, u32), Vec<usize>);

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    refine(arguments).map(|_| ())
}

/// Runs the command; returns the mean seconds per pose that was refined or kept by the pipeline, `None` without any.
pub(super) fn refine(arguments: &Arguments) -> anyhow::Result<Option<f64>> {
    let mut inputs = vec![("--results", arguments.results.as_path())];
    inputs.extend(
        arguments
            .pipeline
            .file()
            .map(|p| ("--pipeline", p.as_path())),
    );
    inputs.extend(arguments.detections.as_deref().map(|p| ("--detections", p)));
    outputs::check(
        &[("--output", &arguments.output)],
        &inputs,
        &[("--output", "--results")],
    )?;
    let pipeline = arguments.pipeline.choose()?;
    let mut rows = arguments.rows()?;
    let dataset = Dataset::open(&arguments.dataset)?.with_limits(limits());
    dataset.scene_ids(&arguments.split)?;
    let detections = match &arguments.detections {
        Some(path) => Some(limits().read_detections(path)?),
        None => None,
    };
    let frames = frames_of(&rows);
    let pool = thread_pool(arguments.threads, frames.len())?;

    let start = Instant::now();
    let settings = arguments.settings(&pipeline, &rows, detections.as_deref());
    let job = pool.install(|| Job::prepare(arguments, &dataset, detections, &rows))?;
    let (journal, mut results) = arguments.journal(&settings, &frames)?;
    let resumed = results.iter().flatten().count();
    let progress = progress_bar(rows.len(), "rows");
    interrupt::can_resume();
    let ran = pool.install(|| {
        results
            .par_iter_mut()
            .zip(&frames)
            // One frame at a time per thread: frames differ in cost by their number of rows.
            .with_max_len(1)
            .enumerate()
            .try_for_each_init(
                || pipeline.refiner(),
                |refiner, (place, (result, ((scene_id, im_id), indices)))| {
                    if interrupt::asked() {
                        bail!("interrupted");
                    }
                    if result.is_none() {
                        let done = job.frame(refiner, *scene_id, *im_id, indices, &rows);
                        if let Some(journal) = &journal {
                            journal.append(place, &done)?;
                        }
                        *result = Some(done);
                    }
                    progress.inc(indices.len() as u64);
                    Ok::<(), anyhow::Error>(())
                },
            )
    });
    progress.finish_and_clear();
    if interrupt::asked() && ran.is_err() && journal.is_some() {
        bail!(
            "interrupted: {} of {} frames are done; --resume goes on from there",
            results.iter().flatten().count(),
            frames.len()
        );
    }
    ran?;
    let results: Vec<FrameResult> = results.into_iter().flatten().collect();

    for (result, (_, indices)) in results.iter().zip(&frames) {
        enter(result, indices, &mut rows, arguments);
    }
    hicp_io::bop::write_results(&arguments.output, &rows)?;
    if let Some(journal) = journal {
        journal.remove()?;
    }

    let mut summary = format!(
        "{}: {} rows of {} frames in {:.1} s on {} threads",
        arguments.output.display(),
        rows.len(),
        frames.len(),
        start.elapsed().as_secs_f64(),
        pool.current_num_threads(),
    );
    if resumed > 0 {
        let _ = write!(summary, ", {resumed} frames from the journal");
    }
    summary.push_str(&summarize(&results, &job.models.missing));
    say(summary)?;
    report_problems(arguments, &job.models.broken, &results)?;
    let spent: f64 = results.iter().filter_map(|result| result.seconds).sum();
    let rows = results.iter().flat_map(|result| &result.rows);
    let poses = rows.filter(|row| row.mve.is_some()).count();
    Ok((poses > 0).then(|| spent / poses as f64))
}

impl Arguments {
    /// The command without options, but that it goes on with a run that was killed.
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
            pipeline,
            threads,
            no_time: false,
            shard: None,
            limit: None,
            rescore: None,
            resume: true,
        }
    }

    /// Reads the rows that are to be refined and written.
    fn rows(&self) -> anyhow::Result<Vec<ResultRow>> {
        let mut rows = limits().read_results(&self.results)?;
        if let Some(limit) = self.limit {
            rows.truncate(limit as usize);
        }
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

    /// What the results depend on: a run goes on only with the work of one that has the same.
    fn settings(
        &self,
        pipeline: &Pipeline,
        rows: &[ResultRow],
        detections: Option<&[Detection]>,
    ) -> Vec<(&'static str, String)> {
        let stated = |value: Option<String>| value.unwrap_or_else(|| "not given".to_owned());
        let dataset = self.dataset.canonicalize();
        let dataset = dataset.unwrap_or_else(|_| self.dataset.clone());
        vec![
            ("hybrid-icp", env!("CARGO_PKG_VERSION").to_owned()),
            ("--dataset", dataset.display().to_string()),
            ("--split", self.split.clone()),
            ("--limit", stated(self.limit.map(|limit| limit.to_string()))),
            ("--shard", stated(self.shard.map(|shard| shard.to_string()))),
            ("--results with the digest", digest(&rows)),
            (
                "--detections with the digest",
                stated(detections.map(|list| digest(&list))),
            ),
            ("--pipeline", pipeline.name().to_owned()),
            (
                "--pipeline with the digest",
                digest(&(pipeline.toml(), pipeline.overrides())),
            ),
        ]
    }

    /// Opens the journal, and returns it with what it holds of the frames. There is none for what is not a file.
    fn journal(
        &self,
        settings: &[(&str, String)],
        frames: &[FrameRows],
    ) -> anyhow::Result<(Option<Journal>, Vec<Option<FrameResult>>)> {
        let mut results: Vec<Option<FrameResult>> = frames.iter().map(|_| None).collect();
        if self.output.exists() && !self.output.is_file() {
            return Ok((None, results));
        }
        let path = Journal::path_of(&self.output);
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

/// A digest of all that the debug form of a value shows.
fn digest(value: &impl fmt::Debug) -> String {
    struct Digest(DefaultHasher);
    impl fmt::Write for Digest {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            self.0.write(text.as_bytes());
            Ok(())
        }
    }
    let mut digest = Digest(DefaultHasher::new());
    // Nothing above fails.
    let _ = write!(digest, "{value:?}");
    format!("{:016x}", digest.0.finish())
}

/// Groups the rows by frame, in the order of scene and image.
fn frames_of(rows: &[ResultRow]) -> Vec<FrameRows> {
    let mut frames: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        let frame = (row.scene_id, row.im_id);
        frames.entry(frame).or_default().push(index);
    }
    frames.into_iter().collect()
}

/// Enters a frame's poses, scores and its time, the same for all of its rows, into the file's rows.
fn enter(result: &FrameResult, indices: &[usize], rows: &mut [ResultRow], arguments: &Arguments) {
    let stated = indices.iter().filter_map(|index| rows[*index].time_s);
    let stated = stated.reduce(f64::max);
    let time_s = match result.seconds {
        _ if arguments.no_time => None,
        Some(seconds) => Some(stated.unwrap_or(0.0) + seconds),
        None => stated,
    };
    for refined in &result.rows {
        let row = &mut rows[refined.index];
        row.time_s = time_s;
        if let Some(pose) = refined.pose {
            row.set_camera_from_object(pose);
        }
        if arguments.rescore == Some(Rescore::Mve) {
            row.score = refined.mve.map_or(0.0, |(_, mve)| 1.0 - mve);
        }
    }
}

/// Counts the rows by what became of them.
fn summarize(results: &[FrameResult], missing_models: &[u32]) -> String {
    let mut counts: BTreeMap<Fate, usize> = BTreeMap::new();
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for refined in results.iter().flat_map(|result| &result.rows) {
        *counts.entry(refined.fate).or_default() += 1;
        if let Some((mve_initial, mve)) = refined.mve {
            before.push(mve_initial);
            after.push(mve);
        }
    }
    let mut text = String::new();
    for (fate, count) in &counts {
        text.push_str(&format!("\n  {count:>7}  {}", fate.describe()));
        if *fate == Fate::MissingModel {
            let ids: Vec<String> = missing_models.iter().map(u32::to_string).collect();
            text.push_str(&format!(" (object {})", ids.join(", ")));
        }
    }
    if let (Some(before), Some(after)) = (median(&mut before), median(&mut after)) {
        text.push_str(&format!("\n  median MVE {before:.3} -> {after:.3}"));
    }
    text
}

/// Warns of what is missing, and fails where something is damaged or nothing is there.
fn report_problems(
    arguments: &Arguments,
    broken_models: &[String],
    results: &[FrameResult],
) -> anyhow::Result<()> {
    let problems = results.iter().flat_map(|result| &result.problems);
    let damaged = problem::tell(problems, broken_models);
    if damaged > 0 {
        bail!(
            "{} files could not be used; their rows are in {} unchanged",
            damaged,
            arguments.output.display()
        );
    }
    let mut fates = results.iter().flat_map(|result| &result.rows);
    if !results.is_empty() && fates.all(|row| row.fate == Fate::MissingFrame) {
        bail!(
            "{}: none of its frames is in {}, expected --dataset and --split to name the images that it was made for",
            arguments.results.display(),
            arguments.dataset.join(&arguments.split).display()
        );
    }
    Ok(())
}

/// What all frames share; built once.
struct Job {
    models: Models,
    scenes: Scenes,
    detections: Option<BTreeMap<(u32, u32), Vec<Detection>>>,
}

impl Job {
    fn prepare(
        arguments: &Arguments,
        dataset: &Dataset,
        detections: Option<Vec<Detection>>,
        rows: &[ResultRow],
    ) -> anyhow::Result<Self> {
        let objects: BTreeSet<u32> = rows.iter().map(|row| row.obj_id).collect();
        let models = Models::read(&dataset.models_dir()?, &objects)?;
        let scene_ids = rows.iter().map(|row| row.scene_id);
        let scenes = Scenes::open(dataset, &arguments.split, scene_ids);
        let detections = detections.map(|list| {
            let mut by_frame: BTreeMap<_, Vec<_>> = BTreeMap::new();
            for detection in list {
                let frame = (detection.scene_id, detection.image_id);
                by_frame.entry(frame).or_default().push(detection);
            }
            by_frame
        });
        Ok(Self {
            models,
            scenes,
            detections,
        })
    }

    /// Refines the rows of one frame, in order.
    fn frame(
        &self,
        refiner: &mut Refiner,
        scene_id: u32,
        im_id: u32,
        indices: &[usize],
        rows: &[ResultRow],
    ) -> FrameResult {
        let mut result = FrameResult {
            rows: Vec::with_capacity(indices.len()),
            seconds: None,
            problems: Vec::new(),
        };
        let mut frame = match self.scenes.read(scene_id, im_id) {
            Ok(image) => {
                let detections = self.detections.as_ref().map(|by_frame| {
                    let of_frame = by_frame.get(&(scene_id, im_id));
                    of_frame.map_or(&[][..], Vec::as_slice)
                });
                Frame::new(image, detections)
            }
            Err(problem) => {
                let fate = Fate::from(&problem);
                result.rows = indices.iter().map(|i| unrefined(*i, fate)).collect();
                result.problems.push(problem);
                return result;
            }
        };
        for &index in indices {
            let row = &rows[index];
            let Some(model) = self.models.by_id.get(&row.obj_id) else {
                let fate = if self.models.missing.contains(&row.obj_id) {
                    Fate::MissingModel
                } else {
                    Fate::Damaged
                };
                result.rows.push(unrefined(index, fate));
                continue;
            };
            let init = row.camera_from_object();
            let start = Instant::now();
            let chosen = frame.choose(refiner, model, row.obj_id, &init);
            let observation = match chosen {
                Ok(observation) => observation,
                Err(fate) => {
                    result.rows.push(unrefined(index, fate));
                    continue;
                }
            };
            let refinement = refiner.refine(model, observation, &init);
            *result.seconds.get_or_insert(0.0) += start.elapsed().as_secs_f64();
            let mve = Some((refinement.mve_initial, refinement.mve));
            result.rows.push(match refinement.outcome.verdict {
                Verdict::Refined => Refined {
                    index,
                    fate: Fate::Refined,
                    pose: Some(refinement.outcome.camera_from_object),
                    mve,
                },
                Verdict::KeptInitial(reason) => Refined {
                    index,
                    fate: Fate::Kept(report::explain(reason)),
                    pose: None,
                    mve,
                },
            });
        }
        result.problems = frame.problems;
        result
    }
}

fn unrefined(index: usize, fate: Fate) -> Refined {
    Refined {
        index,
        fate,
        pose: None,
        mve: None,
    }
}
