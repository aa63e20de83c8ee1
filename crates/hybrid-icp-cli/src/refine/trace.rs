//! A trace of every iteration, one JSON object per line.

use std::ops::ControlFlow;
use std::path::Path;

use anyhow::bail;
use hybrid_icp::Trace;
use hybrid_icp::core::Isometry3;
use hybrid_icp::icp::{IterationEvent, Observer, RegimeEvent, StageEvent};
use serde_json::{Value, json};

use super::inputs::Inputs;
use crate::choice::Pipeline;
use crate::pose_json::add_pose;

/// Stores the stages for the report and, with a header, a line for every event.
///
/// A line has the keys of a pose file, so the line of any iteration can be the `--init` of another
/// run. The first line names the pipeline and the files, so that `hybrid-icp replay` can repeat the
/// run.
#[derive(Debug, Default)]
pub(super) struct TraceLines {
    pub(super) trace: Trace,
    lines: Option<Vec<Value>>,
}

impl TraceLines {
    /// Creates a trace that starts with a header. Without a header, it stores no lines.
    pub(super) fn new(header: Option<Value>) -> Self {
        Self {
            trace: Trace::new(),
            lines: header.map(|header| vec![header]),
        }
    }

    /// Returns the lines so far.
    pub(super) fn lines(&self) -> &[Value] {
        self.lines.as_deref().unwrap_or_default()
    }

    /// Writes the lines.
    pub(super) fn write(&self, path: &Path) -> Result<(), hicp_io::IoError> {
        hicp_io::write_atomically(path, |file| {
            let mut lines = self.lines().iter();
            lines.try_for_each(|line| writeln!(file, "{line}"))
        })
    }

    /// Adds a line about the current stage, with a pose, if lines are stored.
    fn push(&mut self, pose: Option<&Isometry3<f64>>, line: impl FnOnce() -> Value) {
        if let Some(lines) = &mut self.lines {
            let mut line = line();
            line["stage"] = json!(self.trace.stages.len() + 1);
            if let Some(pose) = pose {
                add_pose(&mut line, pose);
            }
            lines.push(line);
        }
    }
}

/// Returns the first line of a trace: all inputs of the run except `depth_scale`.
///
/// Fails if a path is not UTF-8, because JSON cannot represent it.
pub(super) fn header(inputs: &Inputs, pipeline: &Pipeline) -> anyhow::Result<Value> {
    for (option, path) in inputs.files() {
        if path.to_str().is_none() {
            bail!(
                "{option} names {}, which is not UTF-8 and cannot be written to --trace: rename the file or omit --trace",
                path.display()
            );
        }
    }
    Ok(json!({
        "event": "start",
        "version": env!("CARGO_PKG_VERSION"),
        "pipeline": pipeline.name,
        "toml": pipeline.toml,
        "set": pipeline.overrides,
        "inputs": inputs,
    }))
}

impl Observer for TraceLines {
    fn on_iteration(&mut self, event: &IterationEvent<'_>) -> ControlFlow<()> {
        self.push(Some(event.camera_from_object), || {
            json!({
                "event": "iteration",
                "iteration": event.iteration,
                "n_pairs": event.evaluation.n_pairs,
                "mean_loss": event.evaluation.mean_loss,
            })
        });
        ControlFlow::Continue(())
    }

    fn on_regime(&mut self, event: &RegimeEvent) {
        self.push(
            None,
            || json!({"event": "regime", "regime": event.regime.name(), "score": event.score}),
        );
        self.trace.on_regime(event);
    }

    fn on_stage_end(&mut self, event: &StageEvent<'_>) {
        let outcome = event.outcome;
        self.push(Some(&outcome.camera_from_object), || {
            json!({
                "event": "stage_end",
                "selection": event.selection,
                "association": event.association,
                "filters": event.filters,
                "metric": event.metric,
                "stop_rules": event.stop_rules,
                "n_source": event.n_source,
                "iterations": outcome.iterations,
                "n_pairs": outcome.n_pairs(),
                "termination": outcome.termination.name(),
            })
        });
        self.trace.on_stage_end(event);
    }
}
