//! `hybrid-icp refine`.

mod inputs;
pub(crate) mod replay;
pub(crate) mod report;
mod trace;
pub(crate) mod warnings;

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use hybrid_icp::icp::Verdict;

use self::inputs::{Inputs, Read};
use self::report::Report;
use self::trace::TraceLines;
use crate::choice::PipelineArguments;
use crate::outputs::Files;
use crate::picture::Picture;
use crate::terminal::{say, warn};

/// Refine one pose in one depth image.
///
/// The result is JSON. It has the pose as cam_R_m2c and cam_t_m2c (mm), mve_initial and mve, and
/// the outcome (refined or kept_initial) with its reason. It also has the evidence (what agrees
/// with the pose, what contradicts it, and how well the mask fits), termination, iterations,
/// n_pairs, time_ms, the warnings that are also on standard error, and a trace with one object per
/// stage. If a pose cannot be refined, the result has the numbers of the file; this is not an
/// error.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
pub(crate) struct Arguments {
    #[command(flatten)]
    inputs: Inputs,
    #[command(flatten)]
    pipeline: PipelineArguments,
    /// The file for the JSON result; standard output if not given.
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// A PNG file for a picture: the depth around the object, with the model's outline before
    /// (orange, dashed) and after (blue) the refinement, and the MVE of both poses.
    #[arg(long, value_name = "FILE")]
    overlay: Option<PathBuf>,
    /// A file for the trace: one JSON object per iteration and line, with its pose as in a pose
    /// file. `hybrid-icp replay` runs it again.
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

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.check_files()?;
    let pipeline = arguments.pipeline.choose()?;
    let inputs = &arguments.inputs;
    let trace_path = arguments.trace.as_ref();
    let mut header = trace_path
        .map(|_| trace::header(inputs, &pipeline))
        .transpose()?;
    let Read {
        model,
        depth,
        mask,
        camera,
        init: init_file,
        depth_scale,
    } = inputs.read()?;
    let init = init_file.camera_from_object;

    let mut refiner = pipeline.refiner();
    if let Some(header) = &mut header {
        header["depth_scale"] = depth_scale.into();
    }
    let mut trace = TraceLines::new(header);
    let start = Instant::now();
    let observation = inputs.observe(depth, mask, camera)?;
    let refined = refiner.refine_observed(&model, &observation, &init, &mut trace);
    let time_ms = start.elapsed().as_secs_f64() * 1e3;

    let reason = warnings::reason(&refined, &model, &observation, &init);
    let summary = report::summary(&refined, &reason);
    let mut warnings = warnings::about_units(&model, &observation, &init, inputs, depth_scale);
    warnings.extend(warnings::about_result(&refined));
    let report = Report::new(
        &pipeline.name,
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
    if let Some(path) = trace_path {
        trace.write(path)?;
    }
    if let Some(path) = &arguments.overlay {
        let after = match refined.outcome.verdict {
            Verdict::Refined => "after",
            Verdict::KeptInitial(_) => "after, the same pose",
        };
        let poses = [
            (&init, format!("before: MVE {:.3}", refined.mve_initial)),
            (
                &refined.outcome.camera_from_object,
                format!("{after}: MVE {:.3}", refined.mve),
            ),
        ];
        Picture::before_and_after(&model, &observation, poses)?.write(path)?;
    }
    report.warnings.iter().for_each(warn);
    match arguments.output {
        Some(_) => say(summary),
        None => say(json),
    }
}

impl Arguments {
    fn check_files(&self) -> anyhow::Result<()> {
        let mut files = Files::default()
            .writes("--output", &self.output)
            .writes("--overlay", &self.overlay)
            .writes("--trace", &self.trace);
        for (option, path) in self.inputs.files() {
            files = files.reads(option, [path]);
        }
        // A pose can be refined in place, because the result has the keys of a pose file.
        files
            .reads("--pipeline", self.pipeline.file())
            .check_in_place("--output", "--init")
    }
}
