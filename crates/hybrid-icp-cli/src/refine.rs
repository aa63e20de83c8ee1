//! `hybrid-icp refine`.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_io::LengthUnit;
use hybrid_icp::{Model, Observation, Preset, Refiner, Trace};

use crate::overlay::{AFTER, BEFORE, Picture};
use crate::report::{self, Report};

/// Refines one pose in one depth image and writes the result as JSON: `cam_R_m2c`, `cam_t_m2c` (mm), the MVE before and
/// after, how it ended, and a trace of every stage that ran.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// The object's mesh: OBJ, PLY or STL.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Unit of the mesh's coordinates: m, mm or cm.
    #[arg(long, value_name = "UNIT")]
    model_unit: LengthUnit,
    /// The depth image: 16-bit grey PNG, 0 where nothing was measured.
    #[arg(long, value_name = "FILE")]
    depth: PathBuf,
    /// Millimetres per unit of the depth image; the camera file's depth_scale if not given.
    #[arg(long, value_name = "MM_PER_UNIT")]
    depth_scale: Option<f64>,
    /// The object's mask: a PNG of the same size, not zero on the object.
    #[arg(long, value_name = "FILE")]
    mask: PathBuf,
    /// The camera: JSON with cam_K (nine numbers, row-major), or fx, fy, cx, cy, width, height. Pixel centres at integers.
    #[arg(long, value_name = "FILE")]
    camera: PathBuf,
    /// The rough pose: JSON with cam_R_m2c (nine numbers, row-major) and cam_t_m2c (three, mm).
    #[arg(long, value_name = "FILE")]
    init: PathBuf,
    /// The pipeline; `hybrid-icp pipelines` lists them.
    #[arg(long, value_name = "NAME", default_value_t = Preset::Hybrid)]
    pipeline: Preset,
    /// Where the JSON result goes; standard output if not given.
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Writes the depth image with the model's outline before (orange) and after (blue).
    #[arg(long, value_name = "FILE")]
    overlay: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mask = hicp_io::read_mask_png(&arguments.mask)?;
    let size = (mask.width(), mask.height());
    let camera_file = hicp_io::read_camera_json(&arguments.camera, size)?;
    let Some(depth_scale) = arguments.depth_scale.or(camera_file.depth_scale) else {
        bail!(
            "{}: no depth_scale there, expected --depth-scale (millimetres per unit of the depth image)",
            arguments.camera.display()
        );
    };
    let depth = hicp_io::read_depth_png(&arguments.depth, depth_scale)?;
    let init = hicp_io::read_pose_json(&arguments.init)?.camera_from_object;
    let model = Model::new(hicp_io::read_mesh(&arguments.model, arguments.model_unit)?);
    let picture = arguments
        .overlay
        .as_ref()
        .map(|_| Picture::of_depth(&depth));

    let mut refiner = Refiner::preset(arguments.pipeline);
    let mut trace = Trace::new();
    let start = Instant::now();
    let observation = Observation::new(depth, mask, camera_file.camera).with_context(|| {
        format!(
            "{} and {} do not fit together",
            arguments.depth.display(),
            arguments.mask.display()
        )
    })?;
    let refined = refiner.refine_observed(&model, &observation, &init, &mut trace);
    let time_ms = start.elapsed().as_secs_f64() * 1e3;

    let report = Report::new(arguments.pipeline, &refined, &trace.stages, time_ms);
    let json = serde_json::to_string_pretty(&report)?;
    match &arguments.output {
        Some(path) => {
            hicp_io::write_atomically(path, |file| writeln!(file, "{json}"))?;
            println!("{}", report::summary(&refined));
        }
        None => println!("{json}"),
    }
    report::warn(&refined);
    if let (Some(path), Some(mut picture)) = (&arguments.overlay, picture) {
        let after = refined.outcome.camera_from_object;
        picture.outline(&mut refiner, &model, &observation, &init, BEFORE);
        picture.outline(&mut refiner, &model, &observation, &after, AFTER);
        picture.write(path)?;
    }
    Ok(())
}
