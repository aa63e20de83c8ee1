//! `hybrid-icp bop refine`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_io::IoError;
use hicp_io::bop::{Dataset, Detection, ModelInfo, ResultRow, Rle, Scene};
use hybrid_icp::{
    DepthImage, Isometry3, Model, ModelConfig, Observation, PinholeCamera, Refiner, Verdict,
};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::choice::PipelineArguments;
use crate::terminal::{complain, say, warn};
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

/// What became of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fate {
    Refined,
    MissingModel,
    MissingFrame,
    NoMask,
    NoOverlap,
    Damaged,
    /// The pipeline kept the initial pose, and this is why.
    Kept(&'static str),
}

impl Fate {
    fn describe(self) -> String {
        match self {
            Self::Refined => "refined".to_owned(),
            Self::MissingModel => "kept: missing model".to_owned(),
            Self::MissingFrame => "kept: missing frame".to_owned(),
            Self::NoMask => "kept: no mask of the object".to_owned(),
            Self::NoOverlap => "kept: no overlap with a mask of the object".to_owned(),
            Self::Damaged => "kept: damaged file".to_owned(),
            Self::Kept(reason) => format!("kept by the pipeline: {reason}"),
        }
    }
}

/// Why something of the dataset cannot be used.
#[derive(Clone, Debug)]
struct Problem {
    /// It is not there, which is no fault of the dataset: parts of one are often all that one has.
    missing: bool,
    text: String,
}

impl Problem {
    fn of(error: &IoError) -> Self {
        Self {
            missing: matches!(error, IoError::Missing { .. }),
            text: chain(error),
        }
    }

    fn damaged(text: String) -> Self {
        Self {
            missing: false,
            text,
        }
    }

    fn fate(&self) -> Fate {
        if self.missing {
            Fate::MissingFrame
        } else {
            Fate::Damaged
        }
    }
}

/// The message of an error and of all its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}

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
    let threads = match arguments.threads {
        Some(threads) => usize::from(threads),
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    let pool = rayon::ThreadPoolBuilder::new()
        // More threads than frames have nothing to do.
        .num_threads(threads.min(frames.len().max(1)))
        .build()
        .context("cannot start the threads")?;

    let start = Instant::now();
    let job = pool.install(|| Job::prepare(arguments, &dataset, detections, &rows))?;
    let progress = progress_bar(rows.len());
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
    summary.push_str(&summarize(&results, &job.missing_models));
    say(summary)?;
    report_problems(arguments, &job.broken_models, &results)
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

/// Most problems that are told one by one.
const PROBLEMS_SHOWN: usize = 10;

/// Warns of what is missing, and fails where something is damaged or nothing is there.
fn report_problems(
    arguments: &Arguments,
    broken_models: &[String],
    results: &[FrameResult],
) -> anyhow::Result<()> {
    let problems = results.iter().flat_map(|result| &result.problems);
    let texts = |missing: bool| -> Vec<String> {
        let mut seen = BTreeSet::new();
        let of_kind = problems.clone().filter(|p| p.missing == missing);
        let texts = of_kind.map(|p| p.text.clone());
        texts.filter(|text| seen.insert(text.clone())).collect()
    };
    let (missing, mut damaged) = (texts(true), broken_models.to_vec());
    damaged.extend(texts(false));
    if let Some(first) = missing.first() {
        warn(format_args!(
            "{first}{}",
            match missing.len() - 1 {
                0 => String::new(),
                more => format!(" (and {more} more like it)"),
            }
        ));
    }
    for text in damaged.iter().take(PROBLEMS_SHOWN) {
        complain(text);
    }
    if !damaged.is_empty() {
        bail!(
            "{} files could not be used; their rows are in {} unchanged",
            damaged.len(),
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
    models: BTreeMap<u32, Model>,
    missing_models: Vec<u32>,
    broken_models: Vec<String>,
    scenes: BTreeMap<u32, Result<Scene, Problem>>,
    detections: Option<BTreeMap<(u32, u32), Vec<Detection>>>,
}

impl Job {
    fn prepare(
        arguments: &Arguments,
        dataset: &Dataset,
        detections: Option<Vec<Detection>>,
        rows: &[ResultRow],
    ) -> anyhow::Result<Self> {
        let infos = models_info(dataset)?;
        let objects: BTreeSet<u32> = rows.iter().map(|row| row.obj_id).collect();
        let objects: Vec<u32> = objects.into_iter().collect();
        let read: Vec<_> = objects
            .par_iter()
            .map(|id| (*id, read_model(dataset, infos.get(id), *id)))
            .collect();
        let (mut models, mut missing_models, mut broken_models) =
            (BTreeMap::new(), Vec::new(), Vec::new());
        for (id, model) in read {
            match model {
                Ok(Some(model)) => {
                    models.insert(id, model);
                }
                Ok(None) => missing_models.push(id),
                Err(error) => broken_models.push(chain(&error)),
            }
        }
        let scene_ids: BTreeSet<u32> = rows.iter().map(|row| row.scene_id).collect();
        let scenes = scene_ids
            .into_iter()
            .map(|id| {
                let scene = dataset.scene(&arguments.split, id);
                (id, scene.map_err(|error| Problem::of(&error)))
            })
            .collect();
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
            missing_models,
            broken_models,
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
        let mut frame = match self.open(scene_id, im_id) {
            Ok(frame) => frame,
            Err(problem) => {
                let fate = problem.fate();
                result.rows = indices.iter().map(|i| unrefined(*i, fate)).collect();
                result.problems.push(problem);
                return result;
            }
        };
        for &index in indices {
            let row = &rows[index];
            let Some(model) = self.models.get(&row.obj_id) else {
                let fate = if self.missing_models.contains(&row.obj_id) {
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

    /// Reads a frame's camera and depth, and finds its masks.
    fn open(&self, scene_id: u32, im_id: u32) -> Result<Frame<'_>, Problem> {
        let scene = match self.scenes.get(&scene_id) {
            Some(Ok(scene)) => scene,
            Some(Err(problem)) => return Err(problem.clone()),
            None => {
                return Err(Problem::damaged(format!(
                    "scene {scene_id} was not prepared"
                )));
            }
        };
        let camera = scene.camera(im_id).map_err(|e| Problem {
            missing: !scene.image_ids().any(|id| id == im_id),
            ..Problem::of(&e)
        })?;
        let depth = scene.read_depth(im_id).map_err(|e| Problem::of(&e))?;
        let camera = camera.pinhole(depth.width(), depth.height()).map_err(|e| {
            let file = scene.dir().join("scene_camera.json");
            Problem::damaged(format!("{}, $.{im_id}.cam_K: {e}", file.display()))
        })?;
        let masks = match &self.detections {
            Some(detections) => detections
                .get(&(scene_id, im_id))
                .map_or(&[][..], Vec::as_slice)
                .iter()
                .filter_map(|d| d.segmentation.as_ref().map(|rle| (d.category_id, rle)))
                .map(|(obj_id, rle)| Candidate::new(obj_id, MaskSource::Code(rle)))
                .collect(),
            None => scene
                .ground_truth(im_id)
                .unwrap_or_default()
                .iter()
                .enumerate()
                .map(|(instance, truth)| {
                    Candidate::new(truth.obj_id, MaskSource::Instance(instance))
                })
                .collect(),
        };
        Ok(Frame {
            scene,
            im_id,
            camera,
            depth,
            masks,
            problems: Vec::new(),
        })
    }
}

/// A frame while its rows are refined: depth read once, an observation made once per mask that is asked for.
struct Frame<'a> {
    scene: &'a Scene,
    im_id: u32,
    camera: PinholeCamera,
    depth: DepthImage,
    masks: Vec<Candidate<'a>>,
    /// Masks that could not be used.
    problems: Vec<Problem>,
}

/// A mask that a row may be refined in.
struct Candidate<'a> {
    obj_id: u32,
    source: MaskSource<'a>,
    seen: Seen,
}

/// What a mask cuts out of the frame.
enum Seen {
    /// Nobody asked for it yet.
    Unread,
    /// Its file is not there or cannot be used.
    Unusable(Fate),
    Observed(Box<Observation>),
}

#[derive(Clone, Copy)]
enum MaskSource<'a> {
    /// The visible mask of an instance, by its index in the ground truth.
    Instance(usize),
    /// A detection's run-length code.
    Code(&'a Rle),
}

impl<'a> Candidate<'a> {
    fn new(obj_id: u32, source: MaskSource<'a>) -> Self {
        Self {
            obj_id,
            source,
            seen: Seen::Unread,
        }
    }
}

impl Frame<'_> {
    /// Returns the observation whose mask the silhouette at the initial pose overlaps most, the first among equals, or why there is none.
    fn choose(
        &mut self,
        refiner: &mut Refiner,
        model: &Model,
        obj_id: u32,
        init: &Isometry3<f64>,
    ) -> Result<&Observation, Fate> {
        let mut best: Option<(usize, usize)> = None;
        let mut fate = Fate::NoMask;
        for index in 0..self.masks.len() {
            if self.masks[index].obj_id != obj_id {
                continue;
            }
            match self.observation(index) {
                Ok(observation) => {
                    let overlap = overlap(refiner, model, observation, init);
                    if overlap > best.map_or(0, |(_, most)| most) {
                        best = Some((index, overlap));
                    }
                    fate = fate.max(Fate::NoOverlap);
                }
                Err(unusable) => fate = fate.max(unusable),
            }
        }
        match best {
            Some((index, _)) => self.observation(index),
            None => Err(fate),
        }
    }

    /// Returns what a mask cuts out, made when it is first asked for.
    fn observation(&mut self, index: usize) -> Result<&Observation, Fate> {
        if matches!(self.masks[index].seen, Seen::Unread) {
            let seen = match self.observe(self.masks[index].source) {
                Ok(observation) => Seen::Observed(Box::new(observation)),
                // An instance whose mask is not there is one without a mask.
                Err(problem) if problem.missing => Seen::Unusable(Fate::NoMask),
                Err(problem) => {
                    self.problems.push(problem);
                    Seen::Unusable(Fate::Damaged)
                }
            };
            self.masks[index].seen = seen;
        }
        match &self.masks[index].seen {
            Seen::Observed(observation) => Ok(observation),
            Seen::Unusable(fate) => Err(*fate),
            Seen::Unread => Err(Fate::NoMask),
        }
    }

    fn observe(&self, source: MaskSource<'_>) -> Result<Observation, Problem> {
        let (mask, name) = match source {
            MaskSource::Instance(instance) => {
                let mask = self.scene.read_visible_mask(self.im_id, instance);
                let path = self.scene.visible_mask_path(self.im_id, instance);
                (
                    mask.map_err(|e| Problem::of(&e))?,
                    path.display().to_string(),
                )
            }
            MaskSource::Code(code) => (
                code.to_mask(),
                format!("a segmentation of image {} in --detections", self.im_id),
            ),
        };
        let size = |width: u32, height: u32| format!("{width}x{height}");
        let mask_size = size(mask.width(), mask.height());
        Observation::new(self.depth.clone(), mask, self.camera).map_err(|_| {
            let depth = self.scene.depth_path(self.im_id);
            let depth = depth.map_or_else(|e| e.to_string(), |path| path.display().to_string());
            let depth_size = size(self.depth.width(), self.depth.height());
            Problem::damaged(format!(
                "{name} is {mask_size} pixels but {depth} is {depth_size}, expected the same size"
            ))
        })
    }
}

/// Returns how many pixels of the mask the model covers at a pose. The render is the one that the refinement begins with.
fn overlap(
    refiner: &mut Refiner,
    model: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> usize {
    let problem = hybrid_icp::Problem::new(model, observation);
    let mut context = refiner.workspace_mut().context(&problem);
    let view = context.view(pose);
    let region = view.region();
    let mask = observation.mask();
    (region.v_min..region.v_max)
        .flat_map(|v| (region.u_min..region.u_max).map(move |u| (u, v)))
        .zip(view.depth())
        .filter(|((u, v), z)| **z > 0.0 && mask.get(*u, *v) == Some(true))
        .count()
}

/// Reads the dataset's model sizes and symmetries; empty if it states none.
fn models_info(dataset: &Dataset) -> Result<BTreeMap<u32, ModelInfo>, IoError> {
    if dataset.models_dir()?.join("models_info.json").is_file() {
        dataset.read_models_info()
    } else {
        Ok(BTreeMap::new())
    }
}

/// Reads an object's model; `None` if the dataset has none.
fn read_model(
    dataset: &Dataset,
    info: Option<&ModelInfo>,
    obj_id: u32,
) -> Result<Option<Model>, IoError> {
    if !dataset.model_path(obj_id)?.is_file() {
        return Ok(None);
    }
    let config = ModelConfig {
        diameter: info.map(|i| i.diameter_m),
        symmetries: info.map(|i| i.symmetries.clone()).unwrap_or_default(),
        ..ModelConfig::default()
    };
    Ok(Some(Model::with_config(
        dataset.read_model(obj_id)?,
        config,
    )))
}

fn unrefined(index: usize, fate: Fate) -> Refined {
    Refined {
        index,
        fate,
        pose: None,
        mve: None,
    }
}

/// A bar on a terminal; nothing where standard error is not one.
fn progress_bar(rows: usize) -> ProgressBar {
    let bar = ProgressBar::new(rows as u64);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} rows, {eta} left") {
        bar.set_style(style);
    }
    bar
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
