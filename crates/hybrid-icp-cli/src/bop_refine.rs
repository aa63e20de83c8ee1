//! `hybrid-icp bop refine`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_io::IoError;
use hicp_io::bop::{Dataset, Detection, ModelInfo, ResultRow, Rle, Scene};
use hybrid_icp::{
    DepthImage, Isometry3, Model, ModelConfig, Observation, PinholeCamera, Preset, Problem,
    Refiner, Verdict,
};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

/// Refines every row of a BOP result file against its frame and writes a result file of the same rows in the same order.
///
/// The mask of a row is the visible mask (mask_visib) of the same object that the initial silhouette overlaps most, or
/// one of a detections file. Rows that cannot be refined are kept unchanged and counted by reason at the end. The time
/// column holds the seconds spent on all rows of an image, added to the time that the input states.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The dataset's folder, with models/ and the split's folder.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// The split's folder: test, test_primesense, train_pbr, …
    #[arg(long, value_name = "NAME", default_value = "test")]
    split: String,
    /// The result file to refine (CSV).
    #[arg(long, value_name = "FILE")]
    results: PathBuf,
    /// Where the refined result file goes.
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
    /// Masks from a detections file (JSON with RLE segmentations) instead of mask_visib.
    #[arg(long, value_name = "FILE")]
    detections: Option<PathBuf>,
    /// The pipeline; `hybrid-icp pipelines` lists them.
    #[arg(long, value_name = "NAME", default_value_t = Preset::Hybrid)]
    pipeline: Preset,
    /// Threads; the number of cores if not given. The output does not depend on it, but for the time column.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Writes -1 into the time column.
    #[arg(long)]
    no_time: bool,
}

/// What became of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fate {
    Refined,
    MissingModel,
    MissingFrame,
    NoMask,
    NoOverlap,
    /// The pipeline kept the initial pose, and this is why.
    Kept(&'static str),
}

impl Fate {
    fn describe(self) -> String {
        match self {
            Self::Refined => "refined".to_owned(),
            Self::MissingModel => "missing model".to_owned(),
            Self::MissingFrame => "missing or damaged frame".to_owned(),
            Self::NoMask => "no mask of the object".to_owned(),
            Self::NoOverlap => "no overlap with a mask of the object".to_owned(),
            Self::Kept(reason) => format!("kept by the pipeline: {reason}"),
        }
    }
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
    seconds: f64,
    problem: Option<String>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut rows = hicp_io::bop::read_results(&arguments.results)?;
    let dataset = Dataset::open(&arguments.dataset)?;
    let detections = match &arguments.detections {
        Some(path) => Some(hicp_io::bop::read_detections(path)?),
        None => None,
    };
    let threads = match arguments.threads {
        Some(threads) => usize::from(threads),
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .context("cannot start the threads")?;

    let start = Instant::now();
    let job = pool.install(|| Job::prepare(arguments, &dataset, detections, &rows))?;
    let mut frames: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        frames
            .entry((row.scene_id, row.im_id))
            .or_default()
            .push(index);
    }
    let frames: Vec<_> = frames.into_iter().collect();
    let progress = progress_bar(rows.len());
    let results: Vec<FrameResult> = pool.install(|| {
        frames
            .par_iter()
            // One frame at a time per thread: frames differ in cost by their number of rows.
            .with_max_len(1)
            .map_init(
                || Refiner::preset(arguments.pipeline),
                |refiner, ((scene_id, im_id), indices)| {
                    let result = job.frame(refiner, *scene_id, *im_id, indices, &rows);
                    progress.inc(indices.len() as u64);
                    result
                },
            )
            .collect()
    });
    progress.finish_and_clear();

    let mut counts: BTreeMap<Fate, usize> = BTreeMap::new();
    let (mut before, mut after) = (Vec::new(), Vec::new());
    let mut problems: Vec<String> = job.broken_models;
    for result in &results {
        for refined in &result.rows {
            let row = &mut rows[refined.index];
            *counts.entry(refined.fate).or_default() += 1;
            if let Some(pose) = refined.pose {
                row.set_camera_from_object(pose);
            }
            row.time_s = (!arguments.no_time).then(|| row.time_s.unwrap_or(0.0) + result.seconds);
            if let Some((mve_initial, mve)) = refined.mve {
                before.push(mve_initial);
                after.push(mve);
            }
        }
        problems.extend(result.problem.clone());
    }
    hicp_io::bop::write_results(&arguments.output, &rows)?;

    println!(
        "{}: {} rows of {} frames in {:.1} s on {threads} threads",
        arguments.output.display(),
        rows.len(),
        frames.len(),
        start.elapsed().as_secs_f64(),
    );
    for (fate, count) in &counts {
        println!("  {count:>7}  {}", fate.describe());
    }
    if let (Some(before), Some(after)) = (median(&mut before), median(&mut after)) {
        println!("  median MVE {before:.3} -> {after:.3}");
    }
    if problems.is_empty() {
        Ok(())
    } else {
        for problem in &problems {
            eprintln!("error: {problem}");
        }
        bail!(
            "{} files could not be used; their rows are in the output unchanged",
            problems.len()
        )
    }
}

/// What all frames share; built once.
struct Job {
    models: BTreeMap<u32, Model>,
    broken_models: Vec<String>,
    scenes: BTreeMap<u32, Result<Scene, String>>,
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
        let (mut models, mut broken_models) = (BTreeMap::new(), Vec::new());
        for (id, model) in read {
            match model {
                Ok(Some(model)) => {
                    models.insert(id, model);
                }
                Ok(None) => {}
                Err(error) => broken_models.push(error.to_string()),
            }
        }
        let scene_ids: BTreeSet<u32> = rows.iter().map(|row| row.scene_id).collect();
        let scenes = scene_ids
            .into_iter()
            .map(|id| {
                let scene = dataset.scene(&arguments.split, id);
                (id, scene.map_err(|error| error.to_string()))
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
        let mut frame = match self.open(scene_id, im_id) {
            Ok(frame) => frame,
            Err(problem) => {
                let rows = indices
                    .iter()
                    .map(|index| unrefined(*index, Fate::MissingFrame));
                return FrameResult {
                    rows: rows.collect(),
                    seconds: 0.0,
                    problem: Some(problem),
                };
            }
        };
        let mut result = FrameResult {
            rows: Vec::with_capacity(indices.len()),
            seconds: 0.0,
            problem: None,
        };
        for &index in indices {
            let row = &rows[index];
            let Some(model) = self.models.get(&row.obj_id) else {
                result.rows.push(unrefined(index, Fate::MissingModel));
                continue;
            };
            let init = row.camera_from_object();
            let start = Instant::now();
            let chosen = match frame.choose(refiner, model, row.obj_id, &init) {
                Ok(chosen) => chosen,
                Err(problem) => {
                    result.problem = Some(problem);
                    result.rows.push(unrefined(index, Fate::MissingFrame));
                    continue;
                }
            };
            let observation = match chosen {
                Ok(observation) => observation,
                Err(fate) => {
                    result.rows.push(unrefined(index, fate));
                    continue;
                }
            };
            let refinement = refiner.refine(model, observation, &init);
            result.seconds += start.elapsed().as_secs_f64();
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
                    fate: Fate::Kept(reason.name()),
                    pose: None,
                    mve,
                },
            });
        }
        result
    }

    /// Reads a frame's camera and depth, and finds its masks.
    fn open(&self, scene_id: u32, im_id: u32) -> Result<Frame<'_>, String> {
        let scene = match self.scenes.get(&scene_id) {
            Some(Ok(scene)) => scene,
            Some(Err(problem)) => return Err(problem.clone()),
            None => return Err(format!("scene {scene_id} was not prepared")),
        };
        let camera = scene.camera(im_id).map_err(|e| e.to_string())?;
        let depth = scene.read_depth(im_id).map_err(|e| e.to_string())?;
        let camera = camera
            .pinhole(depth.width(), depth.height())
            .map_err(|e| format!("{}: image {im_id}: {e}", scene.dir().display()))?;
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
}

/// A mask that a row may be refined in.
struct Candidate<'a> {
    obj_id: u32,
    source: MaskSource<'a>,
    observation: Option<Observation>,
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
            observation: None,
        }
    }
}

impl Frame<'_> {
    /// Returns the observation whose mask the silhouette at the initial pose overlaps most, the first among equals.
    ///
    /// The outer error is a damaged file, the inner one a row that cannot be refined.
    fn choose(
        &mut self,
        refiner: &mut Refiner,
        model: &Model,
        obj_id: u32,
        init: &Isometry3<f64>,
    ) -> Result<Result<&Observation, Fate>, String> {
        let mut best: Option<(usize, usize)> = None;
        let mut any = false;
        for index in 0..self.masks.len() {
            if self.masks[index].obj_id != obj_id {
                continue;
            }
            any = true;
            let observation = self.observation(index)?;
            let overlap = overlap(refiner, model, observation, init);
            if overlap > best.map_or(0, |(_, most)| most) {
                best = Some((index, overlap));
            }
        }
        match best {
            Some((index, _)) => self.observation(index).map(Ok),
            None if any => Ok(Err(Fate::NoOverlap)),
            None => Ok(Err(Fate::NoMask)),
        }
    }

    fn observation(&mut self, index: usize) -> Result<&Observation, String> {
        let candidate = &mut self.masks[index];
        let made = match candidate.observation.take() {
            Some(observation) => observation,
            None => {
                let mask = match candidate.source {
                    MaskSource::Instance(instance) => self
                        .scene
                        .read_visible_mask(self.im_id, instance)
                        .map_err(|e| e.to_string())?,
                    MaskSource::Code(code) => code.to_mask(),
                };
                Observation::new(self.depth.clone(), mask, self.camera).map_err(|e| {
                    format!("{}: image {}: {e}", self.scene.dir().display(), self.im_id)
                })?
            }
        };
        Ok(candidate.observation.insert(made))
    }
}

/// Returns how many pixels of the mask the model covers at a pose. The render is the one that the refinement begins with.
fn overlap(
    refiner: &mut Refiner,
    model: &Model,
    observation: &Observation,
    pose: &Isometry3<f64>,
) -> usize {
    let problem = Problem::new(model, observation);
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
