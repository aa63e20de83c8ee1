//! `hybrid-icp estimate`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};

use super::inputs::{ImageFiles, Inputs, MaskOptions, Region};
use super::job::JobOptions;

/// Estimate the pose of an object in one depth image, without an initial pose.
///
/// A search over all rotations finds rough poses in the mask. The pipeline refines the best of
/// them. The result is the JSON of `refine`, without mve_initial. The outcome is estimated or
/// not_found; if nothing was found, there is no pose.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
#[command(group(ArgGroup::new("region").required(true).args(["mask", "bbox"])))]
pub(crate) struct Arguments {
    #[command(flatten)]
    files: ImageFiles,
    /// The object's mask, of the depth image's size: PNG, TIFF, BMP, NPY, NPZ or PGM. Nonzero on
    /// the object, or opaque if the opacity varies.
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    #[command(flatten)]
    mask_options: MaskOptions,
    /// Without a mask: a box around the object, in pixels. The plane around the box, such as a
    /// table, is removed.
    #[arg(
        long,
        value_name = "X,Y,W,H",
        value_parser = bbox,
        allow_hyphen_values = true
    )]
    bbox: Option<Bbox>,
    #[command(flatten)]
    job: JobOptions,
}

/// A box: x, y, width and height, pixels.
type Bbox = [f64; 4];

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

/// Parses a box.
fn bbox(text: &str) -> Result<Bbox, String> {
    let numbers: Result<Vec<f64>, _> = text
        .split(',')
        .map(|number| number.trim().parse())
        .collect();
    let bbox: Option<Bbox> = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    bbox.filter(|[x, y, width, height]| {
        x.is_finite()
            && y.is_finite()
            && width.is_finite()
            && height.is_finite()
            && *width >= 1.0
            && *height >= 1.0
    })
    .ok_or_else(|| {
        "expected x,y,width,height in pixels, with a width and height of 1 or more".to_owned()
    })
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let region = match (&arguments.mask, arguments.bbox) {
        (Some(path), _) => Region::Mask(path.clone(), arguments.mask_options.rule()),
        (None, bbox) => Region::Box(bbox.unwrap_or_default()),
    };
    let inputs = Inputs {
        files: arguments.files.clone(),
        region,
        init: None,
        init_unit: None,
    };
    arguments.job.run(&inputs)
}
