//! `hybrid-icp bop sequence`.

mod camera_path;
mod init;
mod lines;
mod tracker;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::{Arg, Args, ValueEnum};
use hicp_bop::ModelFolder;
use hicp_io::bop::{Dataset, ResultRow, Scene, write_results};
use hybrid_icp::fusion::{CameraMotion, FusionError, FusionMethod};
use hybrid_icp::{Calibration, Isometry3, Model, SequentialEstimator, Warning};

use self::camera_path::CameraPath;
use self::lines::Line;
use self::tracker::Tracker;
use super::refine_warnings::Kind;
use super::{median, models, progress_bar};
use crate::choice::{Pipeline, PipelineArguments};
use crate::limits::limits;
use crate::outputs;
use crate::terminal::{complain, say, warn};

/// Follow one object through a scene, fusing the estimates of its images (§V).
///
/// Images are taken by ascending id. How the camera moved between them comes from cam_R_w2c and cam_t_w2c of
/// scene_camera.json, so the object must stand still in the world. Each image is registered from the pose fused so far, moved
/// with the camera, in the visible mask (mask_visib) of the instance of the object that the model overlaps most at that pose. Where
/// an image has no such mask the pose is moved with the camera alone, and the line says so.
///
/// The output has a line of JSON for every image: the fused pose (cam_R_m2c, cam_t_m2c in mm) with its 6x6 covariance (m and
/// rad; translation first, left perturbation in the camera frame), under "single" the pose from this image alone with its MVE,
/// and what became of it.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
#[command(mut_arg("pipeline", follows))]
pub(crate) struct Arguments {
    /// The dataset's folder, with models/ and the split's folder.
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// The split's folder: test, test_primesense, train_pbr, …
    #[arg(long, value_name = "NAME", default_value = "test")]
    split: String,
    /// The scene.
    #[arg(long, value_name = "ID")]
    scene: u32,
    /// The object.
    #[arg(long, value_name = "ID")]
    object: u32,
    /// The rough pose in the first image: a pose file (JSON), or a result file (CSV), of whose rows for that image and object
    /// the one with the highest score is taken.
    #[arg(long, value_name = "FILE.json|FILE.csv")]
    init: PathBuf,
    /// The image to begin with; the scene's first if not given.
    #[arg(long, value_name = "ID")]
    first: Option<u32>,
    /// The file of lines to write.
    #[arg(long, value_name = "OUT.jsonl")]
    output: PathBuf,
    /// Also write the fused poses as a result file, for bop eval.
    #[arg(long, value_name = "OUT.csv")]
    results: Option<PathBuf>,
    /// How estimates are fused: last-estimate, average, weighted-average, filtering-constant, filtering or most-confident.
    #[arg(long, value_name = "NAME", default_value = "weighted-average")]
    fuser: FusionMethod,
    /// Where the covariance of an estimate comes from.
    #[arg(long, value_enum, value_name = "FROM", default_value_t = Uncertainty::Registration)]
    uncertainty: Uncertainty,
    #[command(flatten)]
    pipeline: PipelineArguments,
}

/// What is followed is refined, not searched for: covariances and gate were fitted to `hybrid`.
fn follows(pipeline: Arg) -> Arg {
    let help = "The pipeline: a name (`hybrid-icp pipelines` lists them) or a TOML file. Covariances are calibrated for `hybrid`; \
        `auto` and `search` may leap from one image to the next";
    pipeline.default_value("hybrid").long_help(help)
}

/// What an estimate's covariance is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Uncertainty {
    /// The registration's own covariance, calibrated, with a gate on the Mahalanobis distance.
    Registration,
    /// The MVE alone, as in the paper, about the object's centre.
    Mve,
}

const USAGE: &str = "\
hybrid-icp bop sequence --dataset <DIR> [--split <NAME>] --scene <ID>
           --object <ID> --init <FILE> --output <OUT.jsonl> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop generate --scenes 1 --images 20 --trajectory --out synthetic
  hybrid-icp bop sequence --dataset synthetic --scene 1 --object 3 \\
      --init synthetic/initial_synthetic-test.csv --output fused.jsonl

Exit codes: 0 done, with the images that had no estimate in the summary; 1 a
file is missing or damaged (lines are still written where that came up on the
way); 2 the command line is wrong.";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.check_outputs()?;
    let pipeline = arguments.pipeline.choose()?;
    let dataset = Dataset::open(&arguments.dataset)?.with_limits(limits());
    let scene = dataset.scene(&arguments.split, arguments.scene)?;
    let path = CameraPath::of(&scene, arguments.first)?;
    check_object(&scene, &path, arguments.object)?;
    let models_dir = dataset.models_dir()?;
    let model = read_model(&models_dir, arguments.object)?;
    let place = (arguments.scene, path.first(), arguments.object);
    let init = init::read(&arguments.init, place)?;
    let estimator = arguments
        .estimator(&pipeline, &model, &init)
        .with_context(|| format!("cannot start from the pose in {}", arguments.init.display()))?;

    let start = Instant::now();
    let progress = progress_bar(path.len(), "images");
    let mut tracker = Tracker::new(&scene, &model, arguments.object, estimator);
    let mut lines = Vec::with_capacity(path.len());
    for (im_id, motion) in path.motions() {
        lines.push(tracker.image(im_id, &motion));
        progress.inc(1);
    }
    progress.finish_and_clear();
    arguments.write(&lines)?;

    let method = arguments.fuser;
    say(format!(
        "{}: {} images of scene {}, object {}, {method} over {} in {:.1} s{}",
        arguments.output.display(),
        lines.len(),
        arguments.scene,
        arguments.object,
        pipeline.name(),
        start.elapsed().as_secs_f64(),
        summarize(&lines),
    ))?;
    let diameter = models::diameter_warning(arguments.object, &model, &models_dir);
    if let Some(text) = &diameter {
        warn(text);
    }
    for (im_id, warning) in tracker.warnings() {
        // One warning about the same number is enough.
        if diameter.is_none() || !matches!(warning, Warning::Diameter { .. }) {
            warn(arguments.in_words(im_id, warning, &models_dir));
        }
    }
    if !lines.iter().any(|line| line.what.is_accepted()) {
        warn(format_args!(
            "{}: none of its {} images was accepted: its poses are not to be trusted",
            arguments.output.display(),
            lines.len()
        ));
    }
    let damaged = tracker.into_damaged();
    damaged.iter().for_each(complain);
    if !damaged.is_empty() {
        bail!(
            "{} files could not be used; {} has their images without an estimate",
            damaged.len(),
            arguments.output.display()
        );
    }
    Ok(())
}

impl Arguments {
    fn check_outputs(&self) -> anyhow::Result<()> {
        let mut written = vec![("--output", self.output.as_path())];
        written.extend(self.results.as_deref().map(|p| ("--results", p)));
        let mut read = vec![("--init", self.init.as_path())];
        read.extend(self.pipeline.file().map(|p| ("--pipeline", p.as_path())));
        outputs::check(&written, &read, &[])?;
        outputs::check_dataset(&written, (&self.dataset, &self.split))
    }

    fn estimator(
        &self,
        pipeline: &Pipeline,
        model: &Model,
        init: &Isometry3<f64>,
    ) -> Result<SequentialEstimator, FusionError> {
        let (stage, method) = (pipeline.stage(), self.fuser);
        match self.uncertainty {
            Uncertainty::Mve => SequentialEstimator::for_object(stage, method, model, init),
            Uncertainty::Registration => {
                let calibration = pipeline
                    .preset()
                    .map_or(Calibration::HYBRID, Calibration::of);
                SequentialEstimator::calibrated(stage, method, &calibration, model, init)
            }
        }
    }

    /// What looks wrong about the inputs, and where to look for the cause.
    fn in_words(&self, im_id: u32, warning: &Warning, models_dir: &Path) -> String {
        let advice = match (Kind::of(warning), warning) {
            (Some(kind), _) => kind.advice("--init"),
            (None, Warning::BehindCamera { .. }) => format!("check {}", self.init.display()),
            (None, _) => format!("check that {} is in mm", models_dir.display()),
        };
        let (scene, object) = (self.scene, self.object);
        format!("object {object} in image {im_id} of scene {scene}: {warning}: {advice}")
    }

    fn write(&self, lines: &[Line]) -> anyhow::Result<()> {
        let (scene, object) = (self.scene, self.object);
        hicp_io::write_atomically(&self.output, |file| {
            let mut lines = lines.iter();
            lines.try_for_each(|line| writeln!(file, "{}", line.json(scene, object)))
        })?;
        if let Some(path) = &self.results {
            let rows = lines.iter();
            let rows = rows.map(|line| ResultRow::new(scene, line.im_id, object, line.fused));
            write_results(path, &rows.collect::<Vec<_>>())?;
        }
        Ok(())
    }
}

/// Makes sure that the ground truth, by which masks are chosen, has the object in some image.
fn check_object(scene: &Scene, path: &CameraPath, object: u32) -> anyhow::Result<()> {
    let file = scene.dir().join("scene_gt.json");
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    for im_id in path.image_ids() {
        for truth in scene.ground_truth(im_id).unwrap_or_default() {
            *counts.entry(truth.obj_id).or_default() += 1;
        }
    }
    if counts.contains_key(&object) {
        return Ok(());
    }
    if hicp_io::is_absent(&file) {
        bail!(
            "{} does not exist, expected one: it says which mask is whose",
            file.display()
        );
    }
    let found: Vec<String> = counts.keys().map(u32::to_string).collect();
    bail!(
        "--object {object} is in no image, expected one of the objects in {}: {}",
        file.display(),
        found.join(", ")
    )
}

/// Reads the object's model, with its size and symmetries where the dataset states them.
fn read_model(dir: &Path, object: u32) -> anyhow::Result<Model> {
    let model = ModelFolder::open_within(limits(), dir)?.read(object)?;
    model.with_context(|| {
        format!(
            "model of object {object} is missing: {} does not exist",
            Dataset::model_path_in(dir, object).display()
        )
    })
}

/// Counts the images by what became of them; the distances from the truth, where it is known, say what fusing did.
fn summarize(lines: &[Line]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let (mut mve, mut single, mut fused) = (Vec::new(), Vec::new(), Vec::new());
    for line in lines {
        *counts.entry(line.what.describe()).or_default() += 1;
        mve.extend(line.single.as_ref().and_then(|single| single.mve));
        if let Some((of_single, of_fused)) = line.off {
            single.push(of_single * 1e3);
            fused.push(of_fused * 1e3);
        }
    }
    let mut text = String::new();
    for (what, count) in counts {
        text.push_str(&format!("\n  {count:>7}  {what}"));
    }
    if let Some(median) = median(&mut mve) {
        text.push_str(&format!("\n  median MVE {median:.3}"));
    }
    if let (Some(single), Some(fused)) = (median(&mut single), median(&mut fused)) {
        text.push_str(&format!(
            "\n  object's centre off by {single:.2} mm from one image, {fused:.2} mm fused (medians, against the ground truth)"
        ));
    }
    text
}

/// The camera does not move before the first image.
fn motion_between(
    before: Option<&Isometry3<f64>>,
    now: &Isometry3<f64>,
) -> Result<CameraMotion, FusionError> {
    before.map_or(Ok(CameraMotion::none()), |before| {
        CameraMotion::new(now * before.inverse())
    })
}
