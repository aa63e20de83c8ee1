//! The report of a refinement: JSON for programs, lines for people.

use std::collections::BTreeMap;

use hicp_io::PoseFile;
use hybrid_icp::icp::{Alternative, Verdict};
use hybrid_icp::{Refinement, StageRecord};
use serde::Serialize;
use serde_json::{Value, json};

use crate::pose_json::add_pose;
use crate::terminal::{row, table};

/// The JSON report of a refinement; lengths in millimeters as in BOP, losses in m².
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    /// `None` if no pose was found.
    #[serde(rename = "cam_R_m2c", skip_serializing_if = "Option::is_none")]
    rotation: Option<[f64; 9]>,
    #[serde(rename = "cam_t_m2c", skip_serializing_if = "Option::is_none")]
    translation_mm: Option<[f64; 3]>,
    pipeline: String,
    outcome: &'static str,
    /// The reason of the outcome in words.
    reason: String,
    termination: &'static str,
    /// `None` without an initial pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    mve_initial: Option<f64>,
    mve: f64,
    /// The probability that the pose is right.
    confidence: f64,
    expected_error_mm: f64,
    expected_error_degrees: f64,
    /// The number of other poses that look alike and explain the image as well.
    look_alikes: f64,
    /// The evidence for and against the pose, by the names of its fields.
    evidence: BTreeMap<&'static str, f64>,
    iterations: usize,
    n_pairs: usize,
    time_ms: f64,
    /// The warnings about the inputs and the result, as on standard error.
    pub(crate) warnings: Vec<String>,
    trace: Vec<StageReport>,
}

/// One ICP stage that ran.
#[derive(Debug, Serialize)]
struct StageReport {
    /// The number of the stage, counted from 1.
    stage: usize,
    /// The choice of the switch before this stage.
    #[serde(skip_serializing_if = "Option::is_none")]
    regime: Option<&'static str>,
    /// The MVE that this choice depends on.
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
        init: Option<&PoseFile>,
        refined: &Refinement,
        reason: String,
        warnings: Vec<String>,
        stages: &[StageRecord],
        time_ms: f64,
    ) -> Self {
        let outcome = &refined.outcome;
        let (rotation, translation_mm) = match outcome.verdict {
            Verdict::Refined => Some(hicp_io::pose_to_bop(&outcome.camera_from_object)),
            // The rotation in the file may be orthogonal only to its number of digits.
            Verdict::KeptInitial(_) => init.map(|init| (init.rotation, init.translation_mm)),
        }
        .unzip();
        Self {
            rotation,
            translation_mm,
            pipeline: pipeline.to_owned(),
            outcome: match (init, outcome.verdict) {
                (Some(_), kind) => kind.name(),
                (None, Verdict::Refined) => "estimated",
                (None, Verdict::KeptInitial(_)) => "not_found",
            },
            reason,
            termination: outcome.termination.name(),
            mve_initial: init.map(|_| refined.mve_initial),
            mve: refined.mve,
            confidence: refined.confidence,
            expected_error_mm: refined.expected_error_meters * 1e3,
            expected_error_degrees: refined.expected_error_degrees,
            look_alikes: refined.look_alikes,
            evidence: BTreeMap::from(refined.evidence.named()),
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
            outcome: outcome.verdict.name(),
        }
    }
}

/// Returns the JSON of another pose.
pub(crate) fn alternative(other: &Alternative) -> Value {
    let mut object = json!({
        "score": other.score,
        "gap": other.gap,
        "rotation_degrees": other.rotation_degrees,
        "mssd_mm": other.mssd_meters * 1e3,
    });
    if let Some(gap) = other.color_gap {
        object["color_gap"] = gap.into();
    }
    add_pose(&mut object, &other.camera_from_object);
    object
}

/// Returns the trace as a table: one line per stage that ran.
pub(crate) fn trace_table(stages: &[StageRecord]) -> String {
    let heads = "stage|regime|association|metric|ended|iterations|pairs|mean loss mm²";
    let mut rows = vec![row(heads)];
    rows.extend((1..).zip(stages).map(|(stage, record): (usize, _)| {
        let outcome = &record.outcome;
        let regime = record.switched.map_or("", |event| event.regime.name());
        let loss = outcome.evaluation.map(|e| e.mean_loss * 1e6);
        vec![
            stage.to_string(),
            regime.to_owned(),
            record.association.to_owned(),
            record.metric.to_owned(),
            outcome.termination.to_string(),
            outcome.iterations.to_string(),
            outcome.n_pairs().to_string(),
            loss.map_or_else(|| "-".to_owned(), |loss| format!("{loss:.4}")),
        ]
    }));
    table(&rows, 5)
}

/// Returns a one-line summary of a refinement, or of an estimate.
pub(crate) fn summary(refined: &Refinement, reason: &str, is_estimate: bool) -> String {
    let (outcome, mve, confidence) = (&refined.outcome, refined.mve, refined.confidence);
    let (iterations, n_pairs) = (outcome.iterations, outcome.n_pairs());
    let (done, before) = match is_estimate {
        true => ("estimated", String::new()),
        false => ("refined", format!("{:.3} -> ", refined.mve_initial)),
    };
    match outcome.verdict {
        Verdict::Refined => format!(
            "{done}: confidence {confidence:.2}, MVE {before}{mve:.3}, {n_pairs} pairs, {iterations} iterations; ended because {reason}"
        ),
        Verdict::KeptInitial(_) if is_estimate => format!("found no pose: {reason}"),
        Verdict::KeptInitial(_) => format!(
            "kept the initial pose: {reason}; confidence {confidence:.2}, MVE {mve:.3}, {iterations} iterations"
        ),
    }
}
