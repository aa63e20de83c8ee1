//! Checks whether the scores of a result file separate correct estimates from wrong ones.

use std::collections::BTreeMap;

use hicp_bop::{EvaluatedObject, Scenes, frames_of};
use hicp_io::bop::ResultRow;
use hybrid_icp::score::{LabeledScore, reliability, roc_area};
use rayon::prelude::*;
use serde::Serialize;

use crate::terminal::table;

/// An estimate is correct if its error against the nearest instance is below this share of the
/// diameter.
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
    /// Estimates whose MSSD is below a tenth of the diameter.
    correct_mssd: usize,
    /// The area for MSSD instead of ADI.
    roc_area_mssd: Option<f64>,
}

/// A line of the reliability table.
#[derive(Debug, Serialize)]
struct Line {
    lower: f64,
    upper: f64,
    estimates: usize,
    share_correct: Option<f64>,
    share_correct_mssd: Option<f64>,
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
        let (judged, by_mssd): (Vec<LabeledScore>, Vec<LabeledScore>) =
            judged.map(|[adi, mssd]| (adi, mssd)).unzip();
        let bins = reliability(&judged, BINS).into_iter();
        let bins = bins.zip(reliability(&by_mssd, BINS));
        Self {
            estimates: judged.len(),
            correct: judged.iter().filter(|j| j.correct).count(),
            roc_area: roc_area(&judged),
            reliability: bins
                .filter(|(bin, _)| bin.count > 0)
                .map(|(bin, by_mssd)| Line {
                    lower: bin.lower,
                    upper: bin.upper,
                    estimates: bin.count,
                    share_correct: bin.share_correct(),
                    share_correct_mssd: by_mssd.share_correct(),
                    mean_score: bin.mean_score(),
                })
                .collect(),
            correct_mssd: by_mssd.iter().filter(|j| j.correct).count(),
            roc_area_mssd: roc_area(&by_mssd),
        }
    }

    /// Returns the figures as lines for people.
    pub(super) fn table(&self) -> String {
        let number = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v:.3}"));
        let area = |area: Option<f64>| match area {
            Some(_) => number(area),
            None => "undefined, because all are correct or all are wrong".to_owned(),
        };
        let heads = [
            "score",
            "estimates",
            "mean score",
            "MSSD < 0.1 d",
            "ADI < 0.1 d",
        ];
        let mut rows = vec![heads.map(str::to_owned)];
        rows.extend(self.reliability.iter().map(|line| {
            [
                format!("{:.1}-{:.1}", line.lower, line.upper),
                line.estimates.to_string(),
                number(line.mean_score),
                number(line.share_correct_mssd),
                number(line.share_correct),
            ]
        }));
        format!(
            "score against MSSD < 0.1 d: {} estimates, {} correct, ROC area {}\n\
             score against ADI < 0.1 d: {} correct, ROC area {}\n{}",
            self.estimates,
            self.correct_mssd,
            area(self.roc_area_mssd),
            self.correct,
            area(self.roc_area),
            table(&rows, 0),
        )
    }
}

/// Judges a row by its ADI and its MSSD to the nearest instance; `None` without ground truth of its
/// object.
fn judge(
    row: &ResultRow,
    scenes: &Scenes,
    objects: &BTreeMap<u32, EvaluatedObject<'_>>,
) -> Option<[LabeledScore; 2]> {
    let scene = scenes.get(row.scene_id).ok()?;
    let truths = scene.ground_truth(row.im_id)?.iter();
    let object = objects.get(&row.obj_id)?;
    let (estimate, diameter) = (row.camera_from_object(), object.points.diameter());
    let of_object = truths.filter(|truth| truth.obj_id == row.obj_id);
    let errors = of_object.map(|truth| {
        let truth = truth.camera_from_object;
        // The benchmark's errors do the same. It also saves the search for the nearest vertices.
        match (estimate.translation.vector - truth.translation.vector).norm() >= diameter {
            true => [f64::INFINITY; 2],
            false => [
                object.points.adi(&estimate, &truth),
                object.points.mssd(&estimate, &truth),
            ],
        }
    });
    let least = errors.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1])])?;
    Some(least.map(|error| LabeledScore {
        score: row.score,
        correct: error < THRESHOLD * diameter,
    }))
}
