//! `hybrid-icp estimate`.

use clap::Args;

use super::inputs::{ImageFiles, Inputs, RegionOptions};
use super::job::JobOptions;

/// Estimate the pose of an object in one depth image, without an initial pose.
///
/// A search over all rotations finds rough poses in the mask. The pipeline refines the best of
/// them. The result is the JSON of `refine`, without mve_initial. The outcome is estimated or
/// not_found; if nothing was found, there is no pose.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    files: ImageFiles,
    #[command(flatten)]
    region: RegionOptions,
    #[command(flatten)]
    job: JobOptions,
}

const USAGE: &str = "\
hybrid-icp estimate --model <FILE> --model-unit <UNIT>
           --depth <FILE> [--depth-scale <MM_PER_UNIT>]
           (--mask <FILE> | --bbox <X,Y,W,H>) --camera <FILE> [OPTIONS]";

const EXAMPLE: &str = "\
Examples:
  hybrid-icp estimate --model mug.ply --model-unit mm \\
      --depth depth.png --depth-scale 0.1 --mask mask.png \\
      --camera camera.json --output estimated.json --overlay overlay.png
  hybrid-icp estimate --model mug.ply --model-unit mm \\
      --depth depth.png --depth-scale 0.1 --bbox 116,57,133,112 \\
      --rgb rgb.png --camera camera.json

`hybrid-icp help refine` shows the form of camera.json.";

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let inputs = Inputs {
        files: arguments.files.clone(),
        region: arguments.region.clone(),
        init: None,
        init_unit: None,
    };
    arguments.job.run(&inputs)
}
