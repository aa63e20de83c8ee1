//! `hybrid-icp bop refine`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::bail;
use clap::Args;
use hicp_io::bop::{Dataset, Detection, ResultRow};
use hybrid_icp::{Isometry3, Refiner, Verdict};
use rayon::prelude::*;

use super::frame::{Fate, Frame};
use super::images::Scenes;
use super::models::Models;
use super::problem::{self, Problem};
use super::{median, progress_bar, thread_pool};
use crate::choice::PipelineArguments;
use crate::terminal::say;
use crate::{outputs, report};

/// Refine every row of a result file.
///
/// The output has the same rows in the same order. The mask of a row is the visible mask (mask_visib) of the same object
/// that the silhouette at the row's pose overlaps most, or one of a detections file. Rows that cannot be refined keep their
/// numbers and are counted by reason at the end. The time column holds the seconds spent on all rows of the image, added to
/// the time that the input states.
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
while refining); 2 the command line is wrong.";

/// A row's result.
struct Refined {
    index: usize,
    fate: Fate,
    pose: Option<Isometry3<f64>>,
    mve: Option<(f64, f64)>,
}

/// All rows of a frame.
struct FrameResult {
    rows: Vec<Refined>,
    /// Spent on its rows; `None` if none got as far as the pipeline.
    seconds: Option<f64>,
    problems: Vec<Problem>,
}

/// Rows of a frame: scene, image and where the rows stand in the file.
type FrameRows = ((u32, u32), Vec<usize>);

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
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
    let mut rows = hicp_io::bop::read_results(&arguments.results)?;
    let dataset = Dataset::open(&arguments.dataset)?;
    dataset.scene_ids(&arguments.split)?;
    let detections = match &arguments.detections {
        Some(path) => Some(hicp_io::bop::read_detections(path)?),
        None => None,
    };
    let frames = frames_of(&rows);
    let pool = thread_pool(arguments.threads, frames.len())?;

    let start = Instant::now();
    let job = pool.install(|| Job::prepare(arguments, &dataset, detections, &rows))?;
    let progress = progress_bar(rows.len(), "rows");
    let results: Vec<FrameResult> = pool.install(|| {
        frames
            .par_iter()
            // One frame at a time per thread: frames differ in cost by their number of rows.
            .with_max_len(1)
            .map_init(
                || pipeline.refiner(),
                |refiner, ((scene_id, im_id), indices)| {
                    let result = job.frame(refiner, *scene_id, *im_id, indices, &rows);
                    progress.inc(indices.len() as u64);
                    result
                },
            )
            .collect()
    });
    progress.finish_and_clear();

    for (result, (_, indices)) in results.iter().zip(&frames) {
        enter(result, indices, &mut rows, arguments.no_time);
    }
    hicp_io::bop::write_results(&arguments.output, &rows)?;

    let mut summary = format!(
        "{}: {} rows of {} frames in {:.1} s on {} threads",
        arguments.output.display(),
        rows.len(),
        frames.len(),
        start.elapsed().as_secs_f64(),
        pool.current_num_threads(),
    );
    summary.push_str(&summarize(&results, &job.models.missing));
    say(summary)?;
    report_problems(arguments, &job.models.broken, &results)
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

/// Enters a frame's poses and its time, the same for all of its rows, into the file's rows.
fn enter(result: &FrameResult, indices: &[usize], rows: &mut [ResultRow], no_time: bool) {
    let stated = indices.iter().filter_map(|index| rows[*index].time_s);
    let stated = stated.reduce(f64::max);
    let time_s = match result.seconds {
        _ if no_time => None,
        Some(seconds) => Some(stated.unwrap_or(0.0) + seconds),
        None => stated,
    };
    for refined in &result.rows {
        let row = &mut rows[refined.index];
        row.time_s = time_s;
        if let Some(pose) = refined.pose {
            row.set_camera_from_object(pose);
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
