//! Checks whether the scores of a result file separate correct estimates from wrong ones.

use std::collections::BTreeMap;

use hicp_bop::{EvaluatedObject, Scenes, frames_of};
use hicp_io::bop::ResultRow;
use hybrid_icp::score::{LabeledScore, reliability, roc_area};
use rayon::prelude::*;
use serde::Serialize;

use crate::terminal::table;

/// An estimate is correct if its ADI to the nearest instance is below this share of the diameter.
const THRESHOLD: f64 = 0.1;
/// Number of score ranges in the reliability table.
const BINS: usize = 10;

/// The relation between scores and correctness.
#[derive(Debug, Serialize)]
pub(super) struct Calibration {
    /// Rows with ground truth of their object in their image.
    estimates: usize,
    /// Estimates whose ADI is below a tenth of the diameter.
    correct: usize,
    /// `null` unless there are correct and wrong estimates.
    roc_area: Option<f64>,
    /// Ranges of the score that contain estimates.
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
    /// Judges every row whose object has ground truth in its image.
    ///
    /// This includes rows that the recalls leave out.
    pub(super) fn of(
        rows: &[ResultRow],
        scenes: &Scenes,
        objects: &BTreeMap<u32, EvaluatedObject<'_>>,
    ) -> Self {
        // Sort rows by image, so that the threads need few scenes at once.
        let frames = frames_of(rows).into_iter();
        let order: Vec<usize> = frames.flat_map(|(_, indices)| indices).collect();
        let judged = order.par_iter().with_max_len(64);
        let judged = judged.filter_map(|index| judge(&rows[*index], scenes, objects));
        let judged: Vec<LabeledScore> = judged.collect();
        let bins = reliability(&judged, BINS).into_iter();
        Self {
            estimates: judged.len(),
            correct: judged.iter().filter(|j| j.correct).count(),
            roc_area: roc_area(&judged),
            reliability: bins
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

    /// Returns the figures as lines for people.
    pub(super) fn table(&self) -> String {
        let number = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v:.3}"));
        let area = match self.roc_area {
            Some(_) => number(self.roc_area),
            None => "undefined, because all are correct or all are wrong".to_owned(),
        };
        let heads = ["score", "estimates", "share correct", "mean score"];
        let mut rows = vec![heads.map(str::to_owned)];
        rows.extend(self.reliability.iter().map(|line| {
            [
                format!("{:.1}-{:.1}", line.lower, line.upper),
                line.estimates.to_string(),
                number(line.share_correct),
                number(line.mean_score),
            ]
        }));
        format!(
            "score against ADI < 0.1 d: {} estimates, {} correct, ROC area {area}\n{}",
            self.estimates,
            self.correct,
            table(&rows, 0)
        )
    }
}

/// Judges a row by its ADI to the nearest instance; `None` without ground truth of its object.
fn judge(
    row: &ResultRow,
    scenes: &Scenes,
    objects: &BTreeMap<u32, EvaluatedObject<'_>>,
) -> Option<LabeledScore> {
    let scene = scenes.get(row.scene_id).ok()?;
    let truths = scene.ground_truth(row.im_id)?.iter();
    let object = objects.get(&row.obj_id)?;
    let (estimate, diameter) = (row.camera_from_object(), object.points.diameter());
    let of_object = truths.filter(|truth| truth.obj_id == row.obj_id);
    let errors = of_object.map(|truth| {
        let truth = truth.camera_from_object;
        // The benchmark's errors do the same. It also saves the search for the nearest vertices.
        match (estimate.translation.vector - truth.translation.vector).norm() >= diameter {
            true => f64::INFINITY,
            false => object.points.adi(&estimate, &truth),
        }
    });
    Some(LabeledScore {
        score: row.score,
        correct: errors.reduce(f64::min)? < THRESHOLD * diameter,
    })
}
