//! Whether the scores of a result file tell right estimates from wrong ones.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use hicp_bop::{Scenes, frames_of};
use hicp_io::bop::ResultRow;
use hybrid_icp::{LabeledScore, reliability, roc_area};
use rayon::prelude::*;
use serde::Serialize;

use super::judge::EvaluatedObject;

/// Share of the diameter below which the ADI to the nearest instance is correct.
const THRESHOLD: f64 = 0.1;
/// Ranges of the reliability table.
const BINS: usize = 10;

/// Scores against correctness.
#[derive(Debug, Serialize)]
pub(crate) struct Calibration {
    /// Rows with ground truth of their object in their image.
    estimates: usize,
    /// Those of them whose ADI is below a tenth of the diameter.
    correct: usize,
    /// `null` unless there are estimates of both kinds.
    roc_area: Option<f64>,
    /// Ranges of the score that hold any estimate.
    reliability: Vec<Line>,
}

/// A line of the reliability table.
#[derive(Debug, Serialize)]
struct Line {
    lower: f64,
    upper: f64,
    estimates: usize,
    share_correct: Option<f64>,
    mean_score: Option<f64>,
}

impl Calibration {
    /// Judges every row whose object has ground truth in its image, also those that the recalls leave out.
    ///
    /// A row is correct when its ADI to the nearest instance is below a tenth of the diameter.
    pub(crate) fn of(
        rows: &[ResultRow],
        scenes: &Scenes,
        objects: &BTreeMap<u32, EvaluatedObject<'_>>,
    ) -> Self {
        let frames = frames_of(rows);
        let labeled = frames
            .par_iter()
            .with_max_len(1)
            .flat_map_iter(|(frame, indices)| {
                let scene = scenes.get(frame.0).ok();
                indices.iter().filter_map(move |index| {
                    let row = &rows[*index];
                    let truths = scene.as_ref()?.ground_truth(frame.1)?;
                    let object = objects.get(&row.obj_id)?;
                    let estimate = row.camera_from_object();
                    let diameter = object.points.diameter();
                    let errors = truths
                        .iter()
                        .filter(|truth| truth.obj_id == row.obj_id)
                        .map(|truth| {
                            let truth = truth.camera_from_object;
                            let apart =
                                (estimate.translation.vector - truth.translation.vector).norm();
                            // As in the benchmark's errors; and the nearest vertices need not be searched.
                            if apart >= diameter {
                                f64::INFINITY
                            } else {
                                object.points.adi(&estimate, &truth)
                            }
                        });
                    let nearest = errors.reduce(f64::min)?;
                    Some(LabeledScore {
                        score: row.score,
                        correct: nearest < THRESHOLD * diameter,
                    })
                })
            });
        Self::from_labeled(&labeled.collect::<Vec<_>>())
    }

    fn from_labeled(labeled: &[LabeledScore]) -> Self {
        let table = reliability(labeled, BINS).into_iter();
        Self {
            estimates: labeled.len(),
            correct: labeled.iter().filter(|j| j.correct).count(),
            roc_area: roc_area(labeled),
            reliability: table
                .filter(|bin| bin.count > 0)
                .map(|bin| Line {
                    lower: bin.lower,
                    upper: bin.upper,
                    estimates: bin.count,
                    share_correct: bin.share_correct(),
                    mean_score: bin.mean_score(),
                })
                .collect(),
        }
    }

    /// The figures as lines for people.
    pub(crate) fn table(&self) -> String {
        let area = self.roc_area;
        let area = area.map_or_else(
            || "not defined, as all are alike".to_owned(),
            |area| format!("{area:.3}"),
        );
        let mut text = format!(
            "score against ADI < 0.1 d: {} estimates, {} correct, ROC area {area}\n{:>9} {:>9} {:>13} {:>10}",
            self.estimates, self.correct, "score", "estimates", "share correct", "mean score",
        );
        let number = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v:.3}"));
        for line in &self.reliability {
            // Writing to a string does not fail.
            let _ = write!(
                text,
                "\n{:>9} {:>9} {:>13} {:>10}",
                format!("{:.1}-{:.1}", line.lower, line.upper),
                line.estimates,
                number(line.share_correct),
                number(line.mean_score),
            );
        }
        text
    }
}
