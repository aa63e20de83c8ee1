//! What a refinement is reported as: JSON for programs, lines for people.

use std::fmt::Write as _;

use hicp_io::PoseFile;
use hybrid_icp::{Refinement, StageRecord, Verdict};
use serde::Serialize;

/// The JSON report of a refinement; lengths in millimetres where BOP has them so, losses in m².
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    #[serde(rename = "cam_R_m2c")]
    rotation: [f64; 9],
    #[serde(rename = "cam_t_m2c")]
    translation_mm: [f64; 3],
    pipeline: String,
    outcome: &'static str,
    /// Why the outcome is what it is, in words.
    reason: String,
    termination: &'static str,
    mve_initial: f64,
    mve: f64,
    iterations: usize,
    n_pairs: usize,
    time_ms: f64,
    /// What looks wrong about the inputs and the result, as it is told on standard error.
    pub(crate) warnings: Vec<String>,
    trace: Vec<StageReport>,
}

/// One ICP stage that ran.
#[derive(Debug, Serialize)]
struct StageReport {
    /// Which it is, from 1.
    stage: usize,
    /// What the switch chose before this stage, and the MVE that it chose by.
    #[serde(skip_serializing_if = "Option::is_none")]
    regime: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    regime_mve: Option<f64>,
    selection: &'static str,
    association: &'static str,
    filters: Vec<&'static str>,
    metric: &'static str,
    stop_rules: Vec<&'static str>,
    n_source: usize,
    iterations: usize,
    n_pairs: usize,
    mean_loss: Option<f64>,
    termination: &'static str,
    outcome: &'static str,
}

impl Report {
    pub(crate) fn new(
        pipeline: &str,
        init: &PoseFile,
        refined: &Refinement,
        reason: String,
        warnings: Vec<String>,
        stages: &[StageRecord],
        time_ms: f64,
    ) -> Self {
        let outcome = &refined.outcome;
        let (rotation, translation_mm) = match outcome.verdict {
            Verdict::Refined => hicp_io::pose_to_bop(&outcome.camera_from_object),
            // The very numbers that were given, though they be orthogonal only to their digits.
            Verdict::KeptInitial(_) => (init.rotation, init.translation_mm),
        };
        Self {
            rotation,
            translation_mm,
            pipeline: pipeline.to_owned(),
            outcome: verdict(outcome.verdict),
            reason,
            termination: outcome.termination.name(),
            mve_initial: refined.mve_initial,
            mve: refined.mve,
            iterations: outcome.iterations,
            n_pairs: outcome.n_pairs(),
            time_ms,
            warnings,
            trace: (1..).zip(stages).map(StageReport::new).collect(),
        }
    }
}

impl StageReport {
    fn new((stage, record): (usize, &StageRecord)) -> Self {
        let outcome = &record.outcome;
        Self {
            stage,
            regime: record.switched.map(|event| event.regime.name()),
            regime_mve: record.switched.and_then(|event| event.score),
            selection: record.selection,
            association: record.association,
            filters: record.filters.clone(),
            metric: record.metric,
            stop_rules: record.stop_rules.clone(),
            n_source: record.n_source,
            iterations: outcome.iterations,
            n_pairs: outcome.n_pairs(),
            mean_loss: outcome.evaluation.map(|e| e.mean_loss),
            termination: outcome.termination.name(),
            outcome: verdict(outcome.verdict),
        }
    }
}

fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Refined => "refined",
        Verdict::KeptInitial(_) => "kept_initial",
    }
}

/// The trace as a table: one line per stage that ran.
pub(crate) fn trace_table(stages: &[StageRecord]) -> String {
    let mut text = format!(
        "{:<5} {:<10} {:<16} {:<14} {:>10} {:>6} {:>13}  ended\n",
        "stage", "regime", "association", "metric", "iterations", "pairs", "mean loss mm²"
    );
    for (stage, record) in (1..).zip(stages) {
        let outcome = &record.outcome;
        let regime = record.switched.map_or("", |event| event.regime.name());
        let loss = outcome
            .evaluation
            .map_or_else(|| "-".to_owned(), |e| format!("{:.4}", e.mean_loss * 1e6));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{stage:<5} {regime:<10} {:<16} {:<14} {:>10} {:>6} {loss:>13}  {}",
            record.association,
            record.metric,
            outcome.iterations,
            outcome.n_pairs(),
            outcome.termination,
        );
    }
    text
}

/// One line about the whole.
pub(crate) fn summary(refined: &Refinement, reason: &str) -> String {
    let outcome = &refined.outcome;
    match outcome.verdict {
        Verdict::Refined => format!(
            "refined: MVE {:.3} -> {:.3}, {} pairs, {} iterations; ended because {reason}",
            refined.mve_initial,
            refined.mve,
            outcome.n_pairs(),
            outcome.iterations,
        ),
        Verdict::KeptInitial(_) => format!(
            "kept the initial pose: {reason}; MVE {:.3}, {} iterations",
            refined.mve, outcome.iterations
        ),
    }
}
