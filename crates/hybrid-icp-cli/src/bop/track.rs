//! `hybrid-icp bop track`.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Error, bail};
use clap::Args;
use hicp_bop::{Fault, Scenes};
use hicp_io::bop::ResultRow;
use hybrid_icp::core::{DepthImage, Isometry3, Model, PinholeCamera};
use hybrid_icp::{TrackState, Tracked, Tracker, TrackerConfig};
use serde_json::{Value, json};

use super::follow::FollowOptions;
use super::statistics::{count, median};
use super::{faults, models};
use crate::options::positive;
use crate::pose_json::add_pose;
use crate::terminal::{counted, progress_bar, warn};

/// Track a moving object through the images of a scene, without masks.
///
/// Images are read by ascending id. Neither the object nor the camera has to stand still, and the
/// camera's motion is not used. The pose in an image is predicted from the motion so far, and
/// refined in the pixels around the predicted silhouette.
///
/// The output has one line of JSON per image: the pose (cam_R_m2c, cam_t_m2c in mm), the state
/// (tracking, doubtful or lost), and the evidence. The score is the share of the visible pixels
/// that agree with the pose (in Python, `agreement`). While an object is lost, its pose is a guess,
/// around which it is searched. deviation_mm is the standard deviation of the least determined
/// displacement (in Python, `deviation`, in meters), and time the seconds that the image took.
/// Use a pose only if its state is tracking. In the result file, the score of a doubtful pose is 0,
/// and a lost object has no row.
///
/// The exit code is 0 even if the object is lost; the summary counts the states. The pose in an
/// image whose depth is missing or damaged is predicted. If a file is damaged, or no depth can be
/// read, the exit code is 1, and the lines are still written.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    follow: FollowOptions,
    /// Number of images per second. Images whose ids are not successive are further apart.
    #[arg(long, value_name = "N", default_value_t = 30.0, value_parser = positive, allow_negative_numbers = true)]
    fps: f64,
}

const USAGE: &str = "\
hybrid-icp bop track --dataset <DIR> [--split <NAME>] --scene <ID>
           --object <ID> --init <FILE> --output <OUT.jsonl> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop generate --scenes 1 --images 20 --moving --out moving
  hybrid-icp bop track --dataset moving --scene 1 --object 1 \\
      --init moving/initial_synthetic-test.csv --output tracked.jsonl";

/// The largest plausible rate of images. Higher ones are probably in other units.
const MAX_FPS: f64 = 1000.0;

/// The result of an image.
struct Line {
    im_id: u32,
    tracked: Tracked,
    seconds: f64,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let follow = &arguments.follow;
    follow.check_files(None, None)?;
    let dataset = follow.dataset.open()?;
    let scenes = Scenes::new(&dataset, &follow.dataset.split, 1);
    let (scene_id, object) = (follow.scene, follow.object);
    let scene = scenes
        .get(scene_id)
        .map_err(|fault| Error::msg(fault.text))?;
    let images = follow.images(&scene)?;
    let models = follow.model(&dataset.models_dir()?)?;
    let model = &models.by_id[&object];
    let start = follow.initial_pose(images[0])?;
    let progress = progress_bar(images.len(), "images");
    let (lines, faults) = arguments.track(&scenes, &images, model, &start)?;
    progress.finish_and_clear();
    let seen = lines.iter().filter(|l| l.tracked.state != TrackState::Lost);
    follow.write(
        lines.iter().map(|line| line.json(scene_id, object)),
        seen.map(|line| line.row(scene_id, object)),
    )?;
    let text = format!(
        "{}: {} of scene {scene_id}, object {object}{}",
        follow.output.display(),
        counted(lines.len(), "image"),
        summarize(&lines),
    );
    follow.say(text)?;
    let fps = arguments.fps;
    if fps > MAX_FPS {
        warn(format_args!(
            "--fps is {fps}, expected the number of images per second, at most {MAX_FPS}: the \
             motion of the object is not predicted"
        ));
    }
    models::warn_of(
        &models,
        &dataset.models_dir()?,
        &dataset.models_info_path()?,
    );
    let damaged = faults::report(faults.iter(), [].iter());
    if faults.len() == lines.len() {
        bail!(
            "the depth of no image could be read: all poses in {} are guesses",
            follow.output.display()
        );
    }
    if !lines.iter().any(Line::is_tracking) {
        follow.distrust(lines.len(), "the object is tracked");
    }
    if let Some(damaged) = damaged {
        bail!(
            "{damaged}; in their images, {} has a predicted pose",
            follow.output.display()
        );
    }
    Ok(())
}

impl Arguments {
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
            let depth = match scenes.read((self.follow.scene, *im_id)) {
                Ok(image) => {
                    let camera = image.camera;
                    tracker.set_camera(camera);
                    let (width, height) = camera.size();
                    if nothing.size() != camera.size() {
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
            let tracked = tracker.step(depth, passed, None)?;
            lines.push(Line {
                im_id: *im_id,
                tracked,
                seconds: clock.elapsed().as_secs_f64(),
            });
        }
        Ok((lines, faults))
    }
}

impl Line {
    fn is_tracking(&self) -> bool {
        self.tracked.state == TrackState::Tracking
    }

    /// Returns the row of a result file. Its score is the agreement, or 0 if the pose is doubtful.
    fn row(&self, scene_id: u32, obj_id: u32) -> ResultRow {
        let pose = self.tracked.camera_from_object;
        let mut row = ResultRow::new(scene_id, self.im_id, obj_id, pose);
        row.score = match self.is_tracking() {
            true => self.tracked.agreement(),
            false => 0.0,
        };
        row
    }

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
    let mut text = count(lines.iter().map(|line| line.tracked.state.name()));
    let mut times: Vec<f64> = lines.iter().map(|line| 1e3 * line.seconds).collect();
    if let Some(median) = median(&mut times) {
        text.push_str(&format!("\n  median time {median:.1} ms"));
    }
    text
}
