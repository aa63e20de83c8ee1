//! One refinement or estimate, from its files to its report.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use hicp_picture::Picture;
use hybrid_icp::icp::Verdict;

use super::inputs::{Inputs, Read};
use super::report::{self, Report};
use super::trace::{self, TraceLines};
use super::warnings;
use crate::choice::PipelineArguments;
use crate::outputs::{Files, check_png, write_json, write_picture};
use crate::terminal::{check_stdout, say, say_beside, warn};

/// The pipeline and the outputs.
#[derive(Debug, Args)]
pub(crate) struct JobOptions {
    #[command(flatten)]
    pipeline: PipelineArguments,
    /// The file for the JSON result; standard output if not given.
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// A JSON file for the distinct other poses that a search found, best first. Each has its pose
    /// and score, the gap (its score minus that of the result), and rotation_degrees and mssd_mm
    /// from the result. If colors tell it apart, color_gap is the margin of their correlation.
    #[arg(long, value_name = "FILE")]
    alternatives: Option<PathBuf>,
    /// A PNG file for a picture: the depth around the object, with the model's outline at the
    /// initial pose (orange, dashed) and at the result (blue), and their MVE.
    #[arg(long, value_name = "FILE")]
    overlay: Option<PathBuf>,
    /// A file for the trace: one JSON object per iteration and line, with its pose as in a pose
    /// file. `hybrid-icp replay` runs it again.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
}

impl JobOptions {
    /// Refines the initial pose of the inputs, or estimates a pose if there is none.
    pub(super) fn run(&self, inputs: &Inputs) -> anyhow::Result<()> {
        inputs.files.object.unit()?;
        let outputs = [&self.output, &self.alternatives, &self.overlay, &self.trace];
        if outputs.iter().all(|path| path.is_none()) {
            check_stdout()?;
        }
        self.check_files(inputs)?;
        let color = inputs.files.rgb.is_some();
        // An estimate compares colors with every pipeline.
        match inputs.init {
            Some(_) => self.pipeline.check_colors(color),
            None => self.pipeline.check_bounds(),
        }
        let pipeline = self.pipeline.choose(color)?;
        let trace_path = self.trace.as_ref();
        let mut header = trace_path
            .map(|_| trace::header(inputs, &pipeline))
            .transpose()?;
        let Read {
            model,
            depth,
            mask,
            color,
            camera,
            init: init_file,
            depth_scale,
            warnings: of_files,
        } = inputs.read()?;
        let init = init_file.as_ref().map(|file| file.camera_from_object);

        let mut refiner = pipeline.refiner();
        if let Some(header) = &mut header {
            header["inputs"]["files"]["depth_scale"] = depth_scale.into();
        }
        let mut trace = TraceLines::new(header);
        let start = Instant::now();
        let observation = inputs.observe(depth, mask, color, camera)?;
        let refined = match &init {
            Some(init) => refiner.refine_observed(&model, &observation, init, &mut trace),
            None => refiner.estimate_observed(&model, &observation, &mut trace),
        };
        let time_ms = start.elapsed().as_secs_f64() * 1e3;

        let found = refined.outcome.camera_from_object;
        let from = init.unwrap_or(found);
        let in_box = inputs.region.mask.is_none();
        let reason = warnings::reason(&refined, &model, &observation, &from, in_box);
        let summary = report::summary(&refined, &reason, init.is_none());
        let doctor = warnings::doctor(inputs);
        let mut warnings = of_files;
        warnings.extend(warnings::about_inputs(
            &model,
            &observation,
            &from,
            inputs,
            depth_scale,
            doctor,
        )?);
        warnings.extend(warnings::about_facts(&model, &observation, inputs));
        warnings.extend(warnings::about_result(&refined, doctor));
        let report = Report::new(
            &pipeline.name,
            init_file.as_ref(),
            &refined,
            reason,
            warnings,
            &trace.trace.stages,
            time_ms,
        );
        if let Some(path) = &self.output {
            write_json(path, &report)?;
        }
        if let Some(path) = &self.alternatives {
            let others = refiner.alternatives().iter().map(report::alternative);
            write_json(path, &others.collect::<Vec<_>>())?;
        }
        if let Some(path) = trace_path {
            trace.write(path)?;
        }
        if let Some(path) = &self.overlay {
            let after = match (&init, refined.outcome.verdict) {
                (None, _) => "estimated",
                (_, Verdict::Refined) => "after",
                (_, Verdict::KeptInitial(_)) => "after, the same pose",
            };
            let before = format!("before: MVE {:.3}", refined.mve_initial);
            let mut poses: Vec<_> = init.iter().map(|init| (init, before.clone())).collect();
            poses.push((&found, format!("{after}: MVE {:.3}", refined.mve)));
            let picture = Picture::before_and_after(&model, &observation, &poses)?;
            write_picture(path, &picture)?;
        }
        report.warnings.iter().for_each(warn);
        match &self.output {
            Some(output) => {
                let others = [&self.alternatives, &self.overlay, &self.trace];
                let [alternatives, overlay, trace] = others.map(Option::as_deref);
                say_beside(&[Some(output), alternatives, overlay, trace], summary)
            }
            None => say(serde_json::to_string_pretty(&report)?),
        }
    }

    fn check_files(&self, inputs: &Inputs) -> anyhow::Result<()> {
        let stdout = PathBuf::from("-");
        let mut files = Files::default()
            .writes("--output", [self.output.as_ref().unwrap_or(&stdout)])
            .writes("--alternatives", &self.alternatives)
            .writes("--overlay", &self.overlay)
            .writes("--trace", &self.trace);
        for (option, path) in inputs.files() {
            files = files.reads(option, [path]);
        }
        // A pose can be refined in place, because the result has the keys of a pose file.
        files
            .reads("--pipeline", self.pipeline.file())
            .check_in_place("--output", "--init")?;
        check_png("--overlay", &self.overlay)
    }
}
