//! `hybrid-icp track`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_bop::Fault;
use hicp_io::{CameraFile, LengthUnit};
use hybrid_icp::checks::warnings_of_model;
use serde_json::json;

use crate::bop::tracking::{Image, Rate};
use crate::limits::limits;
use crate::options::{file_name, positive};
use crate::outputs::Files;
use crate::refine::inputs::{read_camera, to_meters};
use crate::refine::object::ObjectFiles;
use crate::terminal::{counted, progress_bar, say_beside, warn};

/// Track a moving object through depth images, without masks.
///
/// Neither the object nor the camera has to stand still. The pose in an image is predicted from the
/// motion so far, and refined in the pixels around the predicted silhouette.
///
/// The output has one line of JSON per image: the path of the depth image, the pose (cam_R_m2c,
/// cam_t_m2c in mm), the state (tracking, doubtful or lost), and the evidence. `hybrid-icp help bop
/// track` explains the other keys. Use a pose only if its state is tracking.
///
/// The exit code is 0 even if the object is lost; the summary counts the states. The pose in an
/// image that is damaged is predicted; the exit code is then 1, and the lines are still written.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    object: ObjectFiles,
    /// The depth images in their order, or one folder of them. The images of a folder are sorted by
    /// name, whole numbers in it by value. They are equally spaced in time. Formats are those of
    /// `refine`.
    #[arg(long, value_name = "DIR|FILE", required = true, num_args = 1..)]
    depth: Vec<PathBuf>,
    /// Millimeters per unit of the depth images, as for `refine`.
    #[arg(long, value_name = "MM_PER_UNIT", value_parser = positive, allow_negative_numbers = true)]
    depth_scale: Option<f64>,
    /// The camera of the depth images, in a form of `refine`. If it has lens distortion, the images
    /// are undistorted, and the poses belong to the undistorted images.
    #[arg(long, value_name = "FILE")]
    camera: PathBuf,
    /// The rough pose in the first image, in a form of `refine`, such as the output of `estimate`.
    #[arg(long, value_name = "FILE")]
    init: PathBuf,
    /// Unit of the translation of --init: m, mm or cm. If not given: mm for cam_t_m2c, m for all
    /// other forms.
    #[arg(long, value_name = "UNIT")]
    init_unit: Option<LengthUnit>,
    #[command(flatten)]
    rate: Rate,
    /// The file for the lines.
    #[arg(long, value_name = "OUT.jsonl")]
    output: PathBuf,
}

const USAGE: &str = "\
hybrid-icp track --model <FILE> --model-unit <UNIT>
           --depth <DIR|FILE>... [--depth-scale <MM_PER_UNIT>]
           --camera <FILE> --init <FILE> --output <OUT.jsonl> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp track --model mug.ply --model-unit mm --depth recording/depth \\
      --depth-scale 0.1 --camera camera.json --init pose.json \\
      --output tracked.jsonl";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let object = &arguments.object;
    object.unit()?;
    let images = arguments.images()?;
    Files::default()
        .reads("--model", [&object.mesh])
        .reads("--symmetries", &object.symmetries)
        .reads("--depth", &images)
        .reads("--camera", [&arguments.camera])
        .reads("--init", [&arguments.init])
        .writes("--output", [&arguments.output])
        .check()?;
    let (camera, scale) = arguments.camera(&images)?;
    let (model, mut warnings) = object.read(None)?;
    let of_model = warnings_of_model(&model).into_iter();
    warnings.extend(of_model.map(|warning| object.describe(&warning)));
    let start = limits()
        .read_pose(&arguments.init, arguments.init_unit)
        .context("cannot read --init")?;
    let progress = progress_bar(images.len(), "images");
    let read = (0..).zip(&images).map(|(number, path)| {
        progress.inc(1);
        (number, arguments.read(path, &camera, scale))
    });
    let tracked = arguments
        .rate
        .track(&model, &start.camera_from_object, read)?;
    progress.finish_and_clear();
    let lines = images.iter().zip(&tracked.lines);
    let mut lines = lines.map(|(path, line)| line.json(json!({"depth": path.to_string_lossy()})));
    hicp_io::write_atomically(&arguments.output, |file| {
        lines.try_for_each(|line| writeln!(file, "{line}"))
    })?;
    let text = format!(
        "{}: {}{}",
        arguments.output.display(),
        counted(images.len(), "image"),
        tracked.summary()
    );
    say_beside(&[Some(&arguments.output)], text)?;
    arguments.rate.check();
    warnings.iter().for_each(warn);
    let files = [&arguments.init, &object.mesh, &arguments.camera].map(|path| path.display());
    let [init, mesh, camera] = files;
    let advice =
        format!("{init}, --init-unit, {mesh}, --model-unit, {camera}, --depth-scale and --fps");
    tracked.report(&arguments.output, &advice)
}

impl Arguments {
    /// Returns the depth images in their order.
    fn images(&self) -> anyhow::Result<Vec<PathBuf>> {
        let [folder] = &self.depth[..] else {
            return Ok(self.depth.clone());
        };
        if !folder.is_dir() {
            return Ok(self.depth.clone());
        }
        let cannot = || format!("cannot list --depth {}", folder.display());
        let mut images = Vec::new();
        for entry in std::fs::read_dir(folder).with_context(cannot)? {
            images.push(entry.with_context(cannot)?.path());
        }
        images.retain(|path| is_depth(path));
        images.sort_by_cached_key(|path| sortable(&file_name(path)));
        if images.is_empty() {
            bail!(
                "--depth {}: no depth image, expected files that end with {}",
                folder.display(),
                ENDINGS.join(", ")
            );
        }
        Ok(images)
    }

    /// Reads the camera for the first image that can be read, and the millimeters per unit.
    fn camera(&self, images: &[PathBuf]) -> anyhow::Result<(CameraFile, f64)> {
        let read = |path| limits().read_raw_depth(path).map(|depth| (path, depth));
        let first = images.iter().find_map(|path| read(path).ok());
        let (path, depth) = first.map_or_else(|| read(&images[0]), Ok)?;
        let camera = read_camera(&self.camera, depth.size(), path)?;
        let (_, scale) = to_meters(depth, self.depth_scale, &camera, &self.camera)?;
        Ok((camera, scale))
    }

    /// Reads an image, whose size must be that of the camera.
    fn read(&self, path: &Path, camera: &CameraFile, scale: f64) -> Result<Image, Fault> {
        let depth = limits()
            .read_raw_depth(path)
            .map_err(|error| Fault::of(&error))?;
        let ((width, height), (w, h)) = (depth.size(), camera.camera.size());
        if (width, height) != (w, h) {
            return Err(Fault::damaged(format!(
                "{}: {width}x{height} pixels, expected {w}x{h} as the first one",
                path.display()
            )));
        }
        let read = to_meters(depth, Some(scale), camera, &self.camera);
        let (depth, _) = read.map_err(|error| Fault::damaged(format!("{error:#}")))?;
        Ok((camera.camera, Arc::new(depth)))
    }
}

/// The endings of depth images.
const ENDINGS: [&str; 8] = ["png", "tiff", "tif", "npy", "npz", "exr", "pgm", "pfm"];

fn is_depth(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let is_hidden = file_name(path).starts_with('.');
    !is_hidden && ENDINGS.iter().any(|known| ending == *known) && path.is_file()
}

/// Returns a key that sorts names with their numbers by value: `2.png` comes before `10.png`.
fn sortable(name: &str) -> String {
    let mut key = String::new();
    let mut rest = name;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let end = rest[start..].find(|c: char| !c.is_ascii_digit());
        let (number, after) = rest[start..].split_at(end.unwrap_or(rest.len() - start));
        key.push_str(&rest[..start]);
        let digits = number.trim_start_matches('0');
        key.push_str(&format!("{:03}{digits}", digits.len()));
        rest = after;
    }
    key + rest
}
