//! `hybrid-icp bop track`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Error, bail};
use clap::Args;
use hicp_bop::{Fault, Scenes};
use hicp_io::bop::{ResultRow, write_results};
use hybrid_icp::core::{DepthImage, Isometry3, Model, PinholeCamera};
use hybrid_icp::{TrackState, Tracked, Tracker, TrackerConfig};
use serde_json::{Value, json};

use super::options::DatasetOptions;
use super::statistics::median;
use super::{faults, init, models};
use crate::options::positive;
use crate::outputs::Files;
use crate::pose_json::add_pose;
use crate::terminal::{progress_bar, say};

/// Track a moving object through the images of a scene, without masks.
///
/// Images are read by ascending id. Neither the object nor the camera has to stand still, and the
/// camera's motion is not used. The pose in an image is predicted from the motion so far, and
/// refined in the pixels around the predicted silhouette.
///
/// The output has one line of JSON per image: the pose (cam_R_m2c, cam_t_m2c in mm), the state
/// (tracking, doubtful or lost), and the evidence. The score is the share of the visible pixels
/// that agree with the pose. While an object is lost, its pose is a guess, and it is searched
/// around it. deviation_mm is the standard deviation of the least determined displacement.
///
/// The exit code is 0 even if the object is lost; the summary counts the states. The pose in an
/// image whose depth is missing or damaged is predicted. If a file is damaged, the exit code is 1,
/// and the lines are still written.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    dataset: DatasetOptions,
    /// The id of the scene.
    #[arg(long, value_name = "ID")]
    scene: u32,
    /// The id of the object.
    #[arg(long, value_name = "ID")]
    object: u32,
    /// The rough pose in the first image: a pose file (JSON) or a result file (CSV), for example
    /// of bop estimate. Of a result file, the row for that image and object with the highest score
    /// is used.
    #[arg(long, value_name = "FILE.json|FILE.csv")]
    init: PathBuf,
    /// The id of the image to start with; the scene's first if not given.
    #[arg(long, value_name = "ID")]
    first: Option<u32>,
    /// Number of images per second. Images whose ids are not successive are further apart.
    #[arg(long, value_name = "N", default_value_t = 30.0, value_parser = positive, allow_negative_numbers = true)]
    fps: f64,
    /// The file for the lines.
    #[arg(long, value_name = "OUT.jsonl")]
    output: PathBuf,
    /// Also write the poses of tracked and doubtful images as a result file, for bop eval.
    #[arg(long, value_name = "OUT.csv")]
    results: Option<PathBuf>,
}

const USAGE: &str = "\
hybrid-icp bop track --dataset <DIR> [--split <NAME>] --scene <ID>
           --object <ID> --init <FILE> --output <OUT.jsonl> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop generate --scenes 1 --images 20 --moving --out moving
  hybrid-icp bop track --dataset moving --scene 1 --object 1 \\
      --init moving/initial_synthetic-test.csv --output tracked.jsonl";

/// The result of an image.
struct Line {
    im_id: u32,
    tracked: Tracked,
    seconds: f64,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.check_files()?;
    let dataset = arguments.dataset.open()?;
    let scenes = Scenes::new(&dataset, &arguments.dataset.split, 1);
    let (scene_id, object) = (arguments.scene, arguments.object);
    let scene = scenes
        .get(scene_id)
        .map_err(|fault| Error::msg(fault.text))?;
    let images = init::images(&scene, arguments.first)?;
    let models_dir = dataset.models_dir()?;
    let models = models::read(&models_dir, &BTreeSet::from([object]))?;
    let model = models.by_id.get(&object).ok_or_else(|| {
        let broken = models.broken.get(&object).cloned();
        let cause = broken.or_else(|| models::missing(&models, &models_dir));
        Error::msg(cause.unwrap_or_default())
    })?;
    let start = init::read(&arguments.init, (scene_id, images[0], object))?;
    let progress = progress_bar(images.len(), "images");
    let (lines, faults) = arguments.track(&scenes, &images, model, &start)?;
    progress.finish_and_clear();
    arguments.write(&lines)?;
    say(format_args!(
        "{}: {} images of scene {scene_id}, object {object}{}",
        arguments.output.display(),
        lines.len(),
        summarize(&lines),
    ))?;
    let damaged = faults::report(faults.iter(), [].iter());
    if damaged > 0 {
        bail!(
            "{damaged} files could not be used; in their images, {} has a predicted pose",
            arguments.output.display()
        );
    }
    Ok(())
}

impl Arguments {
    fn check_files(&self) -> anyhow::Result<()> {
        let files = Files::default()
            .reads("--init", [&self.init])
            .writes("--output", [&self.output])
            .writes("--results", &self.results);
        files.check()?;
        files.spare_dataset(&self.dataset.root, &self.dataset.split)
    }

    /// Tracks the object through the images, in which unreadable ones show nothing.
    fn track(
        &self,
        scenes: &Scenes,
        images: &[u32],
        model: &Model,
        start: &Isometry3<f64>,
    ) -> anyhow::Result<(Vec<Line>, Vec<Fault>)> {
        // The camera of the first readable image replaces it.
        let unknown = PinholeCamera::new(1.0, 1.0, 0.0, 0.0, 1, 1)?;
        let mut tracker = Tracker::new(model.clone(), unknown, TrackerConfig::default());
        tracker.start(start);
        let (mut lines, mut faults) = (Vec::with_capacity(images.len()), Vec::new());
        let mut nothing = Arc::new(DepthImage::from_meters(1, 1, vec![0.0])?);
        let mut before = images[0];
        for im_id in images {
            let depth = match scenes.read((self.scene, *im_id)) {
                Ok(image) => {
                    let camera = image.camera;
                    tracker.set_camera(camera);
                    let (width, height) = (camera.width(), camera.height());
                    if nothing.width() != width || nothing.height() != height {
                        let pixels = vec![0.0; camera.region().area()];
                        nothing = Arc::new(DepthImage::from_meters(width, height, pixels)?);
                    }
                    image.depth
                }
                Err(fault) => {
                    faults.push(fault);
                    Arc::clone(&nothing)
                }
            };
            let clock = Instant::now();
            let passed = f64::from(im_id - std::mem::replace(&mut before, *im_id)) / self.fps;
            let tracked = tracker.step(&depth, passed, None)?;
            lines.push(Line {
                im_id: *im_id,
                tracked,
                seconds: clock.elapsed().as_secs_f64(),
            });
        }
        Ok((lines, faults))
    }

    fn write(&self, lines: &[Line]) -> anyhow::Result<()> {
        let (scene, object) = (self.scene, self.object);
        hicp_io::write_atomically(&self.output, |file| {
            let mut lines = lines.iter();
            lines.try_for_each(|line| writeln!(file, "{}", line.json(scene, object)))
        })?;
        if let Some(path) = &self.results {
            let seen = lines.iter().filter(|l| l.tracked.state != TrackState::Lost);
            let rows = seen.map(|line| {
                let pose = line.tracked.camera_from_object;
                let mut row = ResultRow::new(scene, line.im_id, object, pose);
                row.score = line.tracked.agreement();
                row
            });
            write_results(path, &rows.collect::<Vec<_>>())?;
        }
        Ok(())
    }
}

impl Line {
    /// Returns the line of JSON.
    fn json(&self, scene_id: u32, obj_id: u32) -> Value {
        let Tracked {
            state, evidence, ..
        } = self.tracked;
        let shares: BTreeMap<_, _> = evidence.named().into_iter().collect();
        let mut line = json!({
            "scene_id": scene_id, "im_id": self.im_id, "obj_id": obj_id, "state": state.name(),
            "score": self.tracked.agreement(), "time": self.seconds, "evidence": shares,
            "deviation_mm": 1e3 * self.tracked.deviation_meters,
        });
        add_pose(&mut line, &self.tracked.camera_from_object);
        line
    }
}

/// Counts the images by state, and adds the median time.
fn summarize(lines: &[Line]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for line in lines {
        *counts.entry(line.tracked.state.name()).or_default() += 1;
    }
    let counts = counts.iter();
    let mut text: String = counts
        .map(|(state, count)| format!("\n  {count:>7}  {state}"))
        .collect();
    let mut times: Vec<f64> = lines.iter().map(|line| 1e3 * line.seconds).collect();
    if let Some(median) = median(&mut times) {
        text.push_str(&format!("\n  median time {median:.1} ms"));
    }
    text
}
