//! A trace of every iteration, one JSON object per line.

use std::ops::ControlFlow;
use std::path::Path;

use anyhow::anyhow;
use hybrid_icp::{Isometry3, IterationEvent, Observer, RegimeEvent, StageEvent, Trace};
use serde_json::{Value, json};

use crate::choice::Pipeline;
use crate::refine::Inputs;

/// Keeps the stages for the report and, if asked to, a line for everything that happens.
///
/// A line holds the pose as a pose file does, so any iteration can be looked at again: cut its line out, and it is the
/// `--init` of another run. The first line says what ran on which files, so that `hybrid-icp replay` can run it again.
#[derive(Debug, Default)]
pub(crate) struct TraceLines {
    pub(crate) trace: Trace,
    lines: Option<Vec<Value>>,
}

impl TraceLines {
    /// Starts with a header, or keeps no lines.
    pub(crate) fn new(header: Option<Value>) -> Self {
        Self {
            trace: Trace::new(),
            lines: header.map(|header| vec![header]),
        }
    }

    /// The lines so far.
    pub(crate) fn lines(&self) -> &[Value] {
        self.lines.as_deref().unwrap_or_default()
    }

    /// Writes the lines.
    pub(crate) fn write(&self, path: &Path) -> Result<(), hicp_io::IoError> {
        hicp_io::write_atomically(path, |file| {
            self.lines()
                .iter()
                .try_for_each(|line| writeln!(file, "{line}"))
        })
    }

    fn stage(&self) -> usize {
        self.trace.stages.len() + 1
    }
}

/// The first line of a trace: everything that the others follow from.
///
/// Paths that are no text cannot stand there: fails as [`check_paths`] does.
pub(crate) fn header(
    inputs: &Inputs,
    depth_scale: f64,
    pipeline: &Pipeline,
) -> anyhow::Result<Value> {
    let mut line = json!({
        "event": "start",
        "version": env!("CARGO_PKG_VERSION"),
        "pipeline": pipeline.name(),
        "toml": pipeline.toml(),
        "set": pipeline.overrides(),
        "model_unit": inputs.model_unit.to_string(),
        "depth_scale": depth_scale,
    });
    for (option, path) in inputs.files() {
        line[option.trim_start_matches('-')] = json!(text_of(option, path)?);
    }
    Ok(line)
}

/// Checks that a trace can name the files: JSON is text, and a path on Unix need not be.
pub(crate) fn check_paths(inputs: &Inputs) -> anyhow::Result<()> {
    let mut files = inputs.files().into_iter();
    files.try_for_each(|(option, path)| text_of(option, path).map(|_| ()))
}

fn text_of<'a>(option: &str, path: &'a Path) -> anyhow::Result<&'a str> {
    path.to_str().ok_or_else(|| {
        anyhow!(
            "{option} names {}, which is not UTF-8: --trace cannot name it, expected another name or no --trace",
            path.display()
        )
    })
}

fn with_pose(mut line: Value, pose: &Isometry3<f64>) -> Value {
    let (rotation, translation_mm) = hicp_io::pose_to_bop(pose);
    line["cam_R_m2c"] = json!(rotation);
    line["cam_t_m2c"] = json!(translation_mm);
    line
}

impl Observer for TraceLines {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        let stage = self.stage();
        if let Some(lines) = &mut self.lines {
            let line = json!({
                "event": "iteration",
                "stage": stage,
                "iteration": event.iteration,
                "n_pairs": event.evaluation.n_pairs,
                "mean_loss": event.evaluation.mean_loss,
            });
            lines.push(with_pose(line, event.camera_from_object));
        }
        ControlFlow::Continue(())
    }

    fn on_regime(&mut self, event: &RegimeEvent) {
        let stage = self.stage();
        if let Some(lines) = &mut self.lines {
            lines.push(json!({
                "event": "regime",
                "stage": stage,
                "regime": event.regime.name(),
                "score": event.score,
            }));
        }
        self.trace.on_regime(event);
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        let stage = self.stage();
        if let Some(lines) = &mut self.lines {
            let outcome = event.outcome;
            let line = json!({
                "event": "stage_end",
                "stage": stage,
                "selection": event.selection,
                "association": event.association,
                "filters": event.filters,
                "metric": event.metric,
                "stop_rules": event.stop_rules,
                "n_source": event.n_source,
                "iterations": outcome.iterations,
                "n_pairs": outcome.n_pairs(),
                "termination": outcome.termination.name(),
            });
            lines.push(with_pose(line, &outcome.camera_from_object));
        }
        self.trace.on_stage_end(event);
    }
}
