//! `hybrid-icp bop track`.

use anyhow::Error;
use clap::Args;
use hicp_bop::Scenes;
use hicp_io::bop::ResultRow;
use hybrid_icp::TrackState;
use serde_json::json;

use super::follow::FollowOptions;
use super::models;
use super::tracking::{Line, Rate};
use crate::terminal::{counted, progress_bar};

/// Track a moving object through the images of a scene, without masks.
///
/// Images are read by ascending id; those whose ids are not successive are further apart. Neither
/// the object nor the camera has to stand still, and the camera's motion is not used. The pose in
/// an image is predicted from the motion so far, and refined in the pixels around the predicted
/// silhouette.
///
/// The output has one line of JSON per image: the pose (cam_R_m2c, cam_t_m2c in mm), the state
/// (tracking, doubtful or lost), and the evidence. The score is the confidence: the probability
/// that the pose is right if no other pose looks like it. While an object is lost, its pose is a
/// guess, around which it is searched. velocity_mm_per_s is the velocity of the object's center
/// relative to the camera, and angular_velocity_deg_per_s its rotation, both in the camera frame.
/// deviation_mm is the standard deviation of the least determined displacement, and time the
/// seconds that the image took. Use a pose only if its state is tracking. In the result file, the
/// score of a doubtful pose is 0, and a lost object has no row.
///
/// The exit code is 0 even if the object is lost; the summary counts the states. The pose in an
/// image whose depth is missing or damaged is predicted. If a file is damaged, or no depth can be
/// read, the exit code is 1, and the lines are still written.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    follow: FollowOptions,
    #[command(flatten)]
    rate: Rate,
}

const USAGE: &str = "\
hybrid-icp bop track --dataset <DIR> [--split <NAME>] --scene <ID>
           --object <ID> --init <FILE> --output <OUT.jsonl> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp bop generate --scenes 1 --images 20 --moving --out moving
  hybrid-icp bop track --dataset moving --scene 1 --object 1 \\
      --init moving/initial_synthetic-test.csv --output tracked.jsonl";

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
    let read = images.iter().map(|&id| {
        progress.inc(1);
        let image = scenes.read((scene_id, id));
        (id, image.map(|image| (image.camera, image.depth)))
    });
    let tracked = arguments.rate.track(model, &start, read)?;
    progress.finish_and_clear();
    let lines = images.iter().zip(&tracked.lines);
    let place = |im_id| json!({"scene_id": scene_id, "im_id": im_id, "obj_id": object});
    follow.write(
        lines.clone().map(|(im_id, line)| line.json(place(im_id))),
        lines
            .filter(|(_, line)| line.tracked.state != TrackState::Lost)
            .map(|(im_id, line)| row(line, (scene_id, *im_id, object))),
    )?;
    follow.say(format!(
        "{}: {} of scene {scene_id}, object {object}{}",
        follow.output.display(),
        counted(images.len(), "image"),
        tracked.summary(),
    ))?;
    arguments.rate.check();
    models::warn_of(
        &models,
        &dataset.models_dir()?,
        &dataset.models_info_path()?,
    );
    tracked.report(&follow.output, &follow.advice())
}

/// Returns the row of a result file. Its score is the confidence, or 0 if the pose is doubtful.
fn row(line: &Line, (scene_id, im_id, obj_id): (u32, u32, u32)) -> ResultRow {
    let mut row = ResultRow::new(scene_id, im_id, obj_id, line.tracked.camera_from_object);
    row.score = match line.is_tracking() {
        true => line.tracked.confidence,
        false => 0.0,
    };
    row
}
