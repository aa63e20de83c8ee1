//! `hybrid-icp refine`, and the parts that it shares with `hybrid-icp estimate`.

pub(crate) mod doctor;
pub(crate) mod estimate;
pub(crate) mod inputs;
mod job;
pub(crate) mod object;
pub(crate) mod replay;
pub(crate) mod report;
mod trace;
pub(crate) mod warnings;

use clap::Args;

use self::inputs::Inputs;
use self::job::JobOptions;

/// Refine one pose in one depth image.
///
/// The result is JSON. It has the pose as cam_R_m2c and cam_t_m2c (mm), the pipeline, and the
/// outcome (refined or kept_initial) with its reason. It has mve_initial and mve, the confidence
/// (the probability that the pose is right), expected_error_mm and expected_error_degrees, and
/// look_alikes (the number of other poses that explain the image as well). It also has the
/// evidence (what agrees with the pose, what contradicts it, and how well the mask fits),
/// termination, iterations, n_pairs, time_ms, the warnings that are also on standard error, and a
/// trace with one object per stage. If a pose cannot be refined, the result has the numbers of the
/// file; this is not an error.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    inputs: Inputs,
    #[command(flatten)]
    job: JobOptions,
}

const USAGE: &str = "\
hybrid-icp refine --model <FILE> --model-unit <UNIT>
           --depth <FILE> [--depth-scale <MM_PER_UNIT>]
           (--mask <FILE> | --bbox <X,Y,W,H>)
           --camera <FILE> --init <FILE> [OPTIONS]";

const EXAMPLE: &str = "\
Examples:
  hybrid-icp refine --model mug.ply --model-unit mm \\
      --depth depth.png --depth-scale 0.1 --mask mask.png \\
      --camera camera.json --init pose.json \\
      --output refined.json --overlay overlay.png
  hybrid-icp refine --model mug.ply --model-unit mm \\
      --depth depth.png --depth-scale 0.1 --rgb rgb.png \\
      --mask mask.png --camera camera.json --init pose.json

camera.json: {\"cam_K\": [572.4, 0, 325.3, 0, 573.6, 242.0, 0, 0, 1]}
         or: {\"fx\": 572.4, \"fy\": 573.6, \"cx\": 325.3, \"cy\": 242.0,
              \"width\": 640, \"height\": 480}
pose.json:   {\"cam_R_m2c\": [1, 0, 0, 0, 1, 0, 0, 0, 1],
              \"cam_t_m2c\": [0, 0, 800]}";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.job.run(&arguments.inputs)
}
