//! `hybrid-icp bop sequence`.

mod camera_path;
mod line;
mod tracker;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context as _, Error, bail};
use clap::{Args, ValueEnum};
use hicp_bop::{MaskSource, Scenes};
use hicp_io::bop::{ResultRow, Scene};
use hybrid_icp::core::{Isometry3, Model};
use hybrid_icp::fusion::{CameraMotion, FusionError, FusionMethod};
use hybrid_icp::{Calibration, SequentialEstimator, Warning};

use self::camera_path::camera_path;
use self::line::Line;
use self::tracker::Tracker;
use super::advice::{advice, is_about_diameter};
use super::follow::FollowOptions;
use super::statistics::{count, median};
use super::tracking::distrust;
use super::{faults, models};
use crate::choice::{Pipeline, PipelineArguments};
use crate::limits::limits;
use crate::terminal::{counted, progress_bar, warn};

/// Follow one object through a scene, fusing the estimates of its images (§V).
///
/// Images are read by ascending id. The camera's motion between them comes from cam_R_w2c and
/// cam_t_w2c of scene_camera.json, so the object must stand still in the world. The initial pose
/// for an image is the pose fused so far, moved with the camera. The mask is that of the object's
/// visible masks (mask_visib), or of its detections, that the model overlaps most at that pose. If
/// an image has no such mask, the pose moves with the camera alone, and the line reports it.
///
/// The output has one line of JSON per image: the fused pose (cam_R_m2c, cam_t_m2c in mm), its 6x6
/// covariance, its confidence (the probability that it is right, judged in this image), and the
/// outcome of the image. Under "single", it has the pose from this image alone with its MVE.
/// Covariances are in m and rad, translation first, for a left perturbation in the camera frame.
///
/// The exit code is 0 even if images have no estimate; the summary counts them. It is 1 if a file
/// is missing or damaged. If this is detected during the run, the lines are still written.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    follow: FollowOptions,
    /// Use the masks of a detections file, as for `bop refine`. Ground truth is then not needed.
    #[arg(long, value_name = "FILE.json")]
    detections: Option<PathBuf>,
    /// The fusion of estimates: last-estimate, average, weighted-average, filtering-constant,
    /// filtering or most-confident.
    #[arg(long, value_name = "NAME", default_value = "weighted-average")]
    fuser: FusionMethod,
    /// The source of an estimate's covariance.
    #[arg(long, value_enum, value_name = "FROM", default_value_t = Uncertainty::Registration)]
    uncertainty: Uncertainty,
    #[command(flatten)]
    pipeline: PipelineArguments,
}

/// The source of an estimate's covariance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Uncertainty {
    /// The calibrated covariance of the registration, with a gate on the Mahalanobis distance (in
    /// Python `covariance="calibrated"`).
    Registration,
    /// The MVE alone, as in the paper, around the object's center (`covariance="mve"`).
    Mve,
}

const USAGE: &str = "\
hybrid-icp bop sequence --dataset <DIR> [--split <NAME>] --scene <ID>
           --object <ID> --init <FILE> --output <OUT.jsonl> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop generate --scenes 1 --images 20 --trajectory --out synthetic
  hybrid-icp bop sequence --dataset synthetic --scene 1 --object 2 \\
      --init synthetic/initial_synthetic-test.csv --output fused.jsonl";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let follow = &arguments.follow;
    follow.check_files(arguments.pipeline.file(), arguments.detections.as_ref())?;
    let pipeline = arguments.pipeline.choose(false)?;
    let dataset = follow.dataset.open()?;
    let scenes = Scenes::new(&dataset, &follow.dataset.split, 1);
    let (scene_id, object) = (follow.scene, follow.object);
    let scene = scenes
        .get(scene_id)
        .map_err(|fault| Error::msg(fault.text))?;
    let path = camera_path(&scene, &follow.images(&scene)?)?;
    let masks = match &arguments.detections {
        Some(path) => MaskSource::detections(limits().read_detections(path)?),
        None => {
            check_object(&scene, &path, object)?;
            MaskSource::Visible
        }
    };
    let models_dir = dataset.models_dir()?;
    let models = follow.model(&models_dir)?;
    let model = &models.by_id[&object];
    let init = follow.initial_pose(path[0].0)?;
    let estimator = arguments
        .estimator(&pipeline, model, &init)
        .with_context(|| format!("cannot start from the pose in {}", follow.init.display()))?;

    let start = Instant::now();
    let progress = progress_bar(path.len(), "images");
    let mut tracker = Tracker::new(&scenes, (scene_id, object), model, &masks, estimator);
    let mut lines = Vec::with_capacity(path.len());
    for (im_id, motion) in &path {
        lines.push(tracker.image(*im_id, motion));
        progress.inc(1);
    }
    progress.finish_and_clear();
    follow.write(
        lines.iter().map(|line| line.json(scene_id, object)),
        lines
            .iter()
            .map(|line| ResultRow::new(scene_id, line.im_id, object, line.fused)),
    )?;

    let (output, method) = (follow.output.display(), arguments.fuser);
    let text = format!(
        "{output}: {} of scene {scene_id}, object {object}, {method} over {} in {:.1} s{}",
        counted(lines.len(), "image"),
        pipeline.name,
        start.elapsed().as_secs_f64(),
        summarize(&lines),
    );
    follow.say(text)?;
    let diameter = models::wrong_diameters(&models, &dataset.models_info_path()?).remove(&object);
    diameter.iter().for_each(warn);
    let (im_id, warnings) = tracker.warnings.unwrap_or_default();
    for warning in warnings {
        // One warning about the same number is enough.
        if diameter.is_none() || !is_about_diameter(&warning) {
            let advice =
                advice(&warning, Some(follow.check_unit())).unwrap_or_else(|| match warning {
                    Warning::BehindCamera { .. } => format!("check {}", follow.init.display()),
                    _ => format!("check that {} is in mm", models_dir.display()),
                });
            warn(format_args!(
                "object {object} in image {im_id} of scene {scene_id}: {warning}: {advice}"
            ));
        }
    }
    if let Some(against) = tracker.check.contradicting() {
        warn(format_args!(
            "{output}: {against} of {} contradict the pose that moved with the camera: check \
             cam_R_w2c and cam_t_w2c (camera from world, mm) in {}, and that the object stands still",
            counted(lines.len(), "image"),
            scene.file("scene_camera").display()
        ));
    } else if tracker.unmasked == lines.len() {
        let of_object = format!("scene_id {scene_id} and category_id {object} for its images");
        warn(format_args!(
            "{output}: none of its {} images has a mask of the object: do not trust its poses, and \
             check that {}",
            lines.len(),
            match &arguments.detections {
                Some(path) => format!("{} has detections with {of_object}", path.display()),
                None =>
                    format!("the masks of object {object} in mask_visib exist and are not empty"),
            }
        ));
    } else if tracker.check.accepted() == 0 {
        let (accepted, advice) = ("an estimate is accepted", follow.advice());
        distrust(&follow.output, accepted, lines.len(), &advice);
    }
    if let Some(damaged) = faults::report(tracker.faults.iter(), [].iter()) {
        bail!("{damaged}; {output} has no estimate for their images");
    }
    Ok(())
}

impl Arguments {
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
                let preset = pipeline.preset;
                let calibration = preset.map_or(Calibration::HYBRID, Calibration::of);
                SequentialEstimator::calibrated(stage, method, &calibration, model, init)
            }
        }
    }
}

/// Checks that the ground truth, which selects the masks, has the object in some image.
fn check_object(scene: &Scene, path: &[(u32, CameraMotion)], object: u32) -> anyhow::Result<()> {
    let file = scene.file("scene_gt");
    let truths = path
        .iter()
        .filter_map(|(im_id, _)| scene.ground_truth(*im_id));
    let found: BTreeSet<u32> = truths.flatten().map(|truth| truth.obj_id).collect();
    if found.contains(&object) {
        return Ok(());
    }
    if hicp_io::is_absent(&file) {
        bail!(
            "{} does not exist, but is required: it assigns masks to objects, unless --detections is given",
            file.display()
        );
    }
    bail!(
        "--object {object} is in no image, expected one of the objects in {}: {}",
        file.display(),
        models::ids(&found)
    )
}

/// Counts the images by outcome.
///
/// If there is ground truth, adds the distances from it, which show the effect of fusion.
fn summarize(lines: &[Line]) -> String {
    let mut text = count(lines.iter().map(|line| line.description));
    let mve = lines.iter().filter_map(|line| line.single.as_ref()?.1);
    if let Some(median) = median(&mut mve.collect::<Vec<_>>()) {
        text.push_str(&format!("\n  median MVE {median:.3}"));
    }
    let off = lines.iter().filter_map(|line| line.off);
    let (mut single, mut fused): (Vec<f64>, Vec<f64>) = off.unzip();
    if let (Some(single), Some(fused)) = (median(&mut single), median(&mut fused)) {
        let (single, fused) = (1e3 * single, 1e3 * fused);
        text.push_str(&format!(
            "\n  median error of the object's center: {single:.2} mm from one image, {fused:.2} mm fused"
        ));
    }
    text
}
