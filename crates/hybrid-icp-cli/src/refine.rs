//! `hybrid-icp refine`.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context as _, bail};
use clap::Args;
use hicp_io::{CameraFile, IoErrorKind, LengthUnit, PoseFile};
use hybrid_icp::{DepthImage, Mask, Model, Observation, PinholeCamera};

use crate::choice::PipelineArguments;
use crate::limits::limits;
use crate::outputs::{self, Named};
use crate::overlay::{AFTER, BEFORE, Picture};
use crate::report::{self, Report};
use crate::terminal::{say, warn};
use crate::trace_lines::{self, TraceLines};
use crate::warnings::{self, Names};

/// What a refinement reads.
#[derive(Debug, Args)]
pub(crate) struct Inputs {
    /// The object's mesh: OBJ, OFF, PLY or STL.
    #[arg(long, value_name = "FILE")]
    pub(crate) model: PathBuf,
    /// Unit of the mesh's coordinates: m, mm or cm.
    #[arg(long, value_name = "UNIT")]
    pub(crate) model_unit: LengthUnit,
    /// The depth image: 16-bit gray PNG, 0 where nothing was measured.
    #[arg(long, value_name = "FILE")]
    pub(crate) depth: PathBuf,
    /// Millimetres per unit of the depth image, such as 1 or 0.1; the camera file's depth_scale if not given.
    #[arg(long, value_name = "MM_PER_UNIT", value_parser = scale, allow_negative_numbers = true)]
    pub(crate) depth_scale: Option<f64>,
    /// The object's mask: a PNG of the depth image's size, not zero on the object.
    #[arg(long, value_name = "FILE")]
    pub(crate) mask: PathBuf,
    /// The camera: JSON with cam_K (nine numbers, row-major), or with fx, fy, cx, cy, width and height. Pixel centres are at integers.
    #[arg(long, value_name = "FILE")]
    pub(crate) camera: PathBuf,
    /// The rough pose: JSON with cam_R_m2c (nine numbers, row-major) and cam_t_m2c (three, mm), model to camera.
    #[arg(long, value_name = "FILE")]
    pub(crate) init: PathBuf,
}

/// Refine one pose in one depth image.
///
/// The result is JSON: the pose as cam_R_m2c and cam_t_m2c (mm), mve_initial and mve, outcome (refined or kept_initial) and
/// its reason, termination, iterations, n_pairs, time_ms, warnings (texts, none where nothing looks wrong: what standard error
/// says), and a trace with one object per stage that ran. A pose that cannot be refined is given back with the numbers of the
/// file; that is an outcome and no error.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    inputs: Inputs,
    #[command(flatten)]
    pipeline: PipelineArguments,
    /// Where the JSON result goes; standard output if not given.
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Where a picture goes: the depth image with the model's outline before (orange) and after (blue), as PNG.
    #[arg(long, value_name = "FILE")]
    overlay: Option<PathBuf>,
    /// Where a trace of every iteration goes: one JSON object per line, each with its pose as in a pose file; `hybrid-icp replay`
    /// runs it again.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
}

const USAGE: &str = "\
hybrid-icp refine --model <FILE> --model-unit <UNIT>
           --depth <FILE> [--depth-scale <MM_PER_UNIT>] --mask <FILE>
           --camera <FILE> --init <FILE> [OPTIONS]";

const EXAMPLE: &str = "\
Example:
  hybrid-icp refine --model mug.ply --model-unit mm \\
      --depth depth.png --depth-scale 0.1 --mask mask.png \\
      --camera camera.json --init pose.json \\
      --output refined.json --overlay overlay.png

camera.json: {\"cam_K\": [572.4, 0, 325.3, 0, 573.6, 242.0, 0, 0, 1]}
         or: {\"fx\": 572.4, \"fy\": 573.6, \"cx\": 325.3, \"cy\": 242.0,
              \"width\": 640, \"height\": 480}
pose.json:   {\"cam_R_m2c\": [1, 0, 0, 0, 1, 0, 0, 0, 1],
              \"cam_t_m2c\": [0, 0, 800]}";

fn scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a finite number above 0, in millimetres per unit".to_owned()),
    }
}

/// What was read.
pub(crate) struct Read {
    pub(crate) model: Model,
    pub(crate) depth: DepthImage,
    pub(crate) mask: Mask,
    pub(crate) camera: PinholeCamera,
    pub(crate) init: PoseFile,
    pub(crate) depth_scale: f64,
}

impl Inputs {
    /// Reads all files.
    pub(crate) fn read(&self) -> anyhow::Result<Read> {
        let (camera_file, depth_scale) = read_camera(self)?;
        let limits = limits();
        Ok(Read {
            depth: limits.read_depth_png(&self.depth, depth_scale)?,
            mask: limits.read_mask_png(&self.mask)?,
            init: limits.read_pose_json(&self.init)?,
            model: Model::new(limits.read_mesh(&self.model, self.model_unit)?),
            camera: camera_file.camera,
            depth_scale,
        })
    }

    /// Makes the observation of what was read.
    pub(crate) fn observe(
        &self,
        depth: DepthImage,
        mask: Mask,
        camera: PinholeCamera,
    ) -> anyhow::Result<Observation> {
        Observation::new(depth, mask, camera).with_context(|| {
            format!(
                "{} and {} do not fit together",
                self.depth.display(),
                self.mask.display()
            )
        })
    }

    /// The files, by the options that name them.
    pub(crate) fn files(&self) -> [Named<'_>; 5] {
        [
            ("--model", &self.model),
            ("--depth", &self.depth),
            ("--mask", &self.mask),
            ("--camera", &self.camera),
            ("--init", &self.init),
        ]
    }
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    check_outputs(arguments)?;
    let pipeline = arguments.pipeline.choose()?;
    let inputs = &arguments.inputs;
    let Read {
        model,
        depth,
        mask,
        camera,
        init: init_file,
        depth_scale,
    } = inputs.read()?;
    let init = init_file.camera_from_object;
    let overlay = arguments.overlay.as_deref();
    let picture = overlay.map(|path| (path, Picture::of_depth(&depth)));

    let mut refiner = pipeline.refiner();
    let header = match &arguments.trace {
        Some(_) => Some(trace_lines::header(inputs, depth_scale, &pipeline)?),
        None => None,
    };
    let mut trace = TraceLines::new(header);
    let start = Instant::now();
    let observation = inputs.observe(depth, mask, camera)?;
    let refined = refiner.refine_observed(&model, &observation, &init, &mut trace);
    let time_ms = start.elapsed().as_secs_f64() * 1e3;

    let reason = warnings::reason(&refined, &model, &observation, &init);
    let summary = report::summary(&refined, &reason);
    let names = Names {
        model: inputs.model.display(),
        model_unit: inputs.model_unit,
        depth: inputs.depth.display(),
        depth_scale,
        mask: inputs.mask.display(),
        init: inputs.init.display(),
    };
    let mut warnings = warnings::about_units(&model, &observation, &init, &names);
    warnings.extend(warnings::about_result(&refined));
    let report = Report::new(
        pipeline.name(),
        &init_file,
        &refined,
        reason,
        warnings,
        &trace.trace.stages,
        time_ms,
    );
    let json = serde_json::to_string_pretty(&report)?;
    if let Some(path) = &arguments.output {
        hicp_io::write_atomically(path, |file| writeln!(file, "{json}"))?;
    }
    if let Some(path) = &arguments.trace {
        trace.write(path)?;
    }
    if let Some((path, mut picture)) = picture {
        let after = refined.outcome.camera_from_object;
        picture.outline(&mut refiner, &model, &observation, &init, BEFORE);
        picture.outline(&mut refiner, &model, &observation, &after, AFTER);
        picture.write(path)?;
    }
    report.warnings.iter().for_each(warn);
    match arguments.output {
        Some(_) => say(summary),
        None => say(json),
    }
}

fn check_outputs(arguments: &Arguments) -> anyhow::Result<()> {
    if arguments.trace.is_some() {
        trace_lines::check_paths(&arguments.inputs)?;
    }
    let outputs: Vec<_> = [
        ("--output", &arguments.output),
        ("--overlay", &arguments.overlay),
        ("--trace", &arguments.trace),
    ]
    .into_iter()
    .filter_map(|(option, path)| Some((option, path.as_deref()?)))
    .collect();
    let mut inputs = arguments.inputs.files().to_vec();
    inputs.extend(
        arguments
            .pipeline
            .file()
            .map(|p| ("--pipeline", p.as_path())),
    );
    // The result has the keys of a pose file: refining one in place makes sense.
    outputs::check(&outputs, &inputs, &[("--output", "--init")])
}

/// Reads the camera and the depth scale, once the sizes of all that has one are known to agree.
fn read_camera(arguments: &Inputs) -> anyhow::Result<(CameraFile, f64)> {
    let (depth, mask) = (arguments.depth.display(), arguments.mask.display());
    let size = hicp_io::read_png_size(&arguments.depth)?;
    let mask_size = hicp_io::read_png_size(&arguments.mask)?;
    if mask_size != size {
        bail!(
            "{mask} is {}x{} pixels but {depth} is {}x{}, expected the same size",
            mask_size.0,
            mask_size.1,
            size.0,
            size.1
        );
    }
    let camera_file = match limits().read_camera_json(&arguments.camera, size) {
        Err(error) if error.kind == IoErrorKind::CameraSize => bail!(
            "{}: found {}, but {depth} is {}x{}, expected the same size",
            error.path.display(),
            error.found,
            size.0,
            size.1
        ),
        read => read?,
    };
    match arguments.depth_scale.or(camera_file.depth_scale) {
        Some(depth_scale) => Ok((camera_file, depth_scale)),
        None => bail!(
            "{}: no depth_scale there, expected it or --depth-scale (millimetres per unit of the depth image)",
            arguments.camera.display()
        ),
    }
}
