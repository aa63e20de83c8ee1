//! The results of refining an image, and their transfer to the rows of the file.

use std::collections::BTreeMap;

use hicp_io::bop::ResultRow;
use hybrid_icp::Warning;
use hybrid_icp::checks::{warning_of_runner_up, warnings_of_result};
use hybrid_icp::core::Isometry3;
use hybrid_icp::icp::Alternative;
use hybrid_icp::score::Flatness;
use serde::{Deserialize, Serialize};

use crate::fault::Fault;
use crate::row_status::RowStatus;

/// The result of refining a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RowResult {
    /// Index of the row in the given rows.
    pub index: usize,
    /// Status of the row.
    pub status: RowStatus,
    /// `camera_from_object` of the result in meters, if it differs from the row's pose.
    pub pose: Option<Isometry3<f64>>,
    /// MVE of the row's pose and of the result's pose; `None` if the row did not reach the
    /// pipeline.
    pub mve: Option<(f64, f64)>,
    /// The probability that the result's pose is right ([`hybrid_icp::Refinement::confidence`]).
    pub confidence: Option<f64>,
    /// Flatness of the surfaces at the result's pose ([`hybrid_icp::Refinement::flatness`]).
    pub flatness: Option<Flatness>,
    /// The distinct other poses that a search found, best first
    /// ([`hybrid_icp::Refiner::alternatives`]).
    #[serde(default)]
    pub alternatives: Vec<Alternative>,
}

impl RowResult {
    /// Returns the reasons not to trust the pose ([`hybrid_icp::checks::warnings_of_result`]).
    ///
    /// Without an MVE, there are none.
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        let (Some((before, after)), Some(confidence)) = (self.mve, self.confidence) else {
            return Vec::new();
        };
        let mut warnings = warnings_of_result(before, after, confidence, self.flatness);
        warnings.extend(self.alternatives.first().and_then(warning_of_runner_up));
        warnings
    }

    /// Creates the result of a row that did not reach the pipeline.
    #[must_use]
    pub fn unrefined(index: usize, status: RowStatus) -> Self {
        Self {
            index,
            status,
            pose: None,
            mve: None,
            confidence: None,
            flatness: None,
            alternatives: Vec::new(),
        }
    }
}

/// The results of all rows of an image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameResult {
    /// One result per row, in the order of the rows.
    pub rows: Vec<RowResult>,
    /// Time spent on these rows in seconds; `None` if no row reached the pipeline.
    pub seconds: Option<f64>,
    /// `true` if a model has colors, and there is no color image.
    #[serde(default)]
    pub uncolored: bool,
    /// Files that were missing or damaged.
    pub faults: Vec<Fault>,
    /// Warnings about the inputs ([`hybrid_icp::warnings`]) by object, from the first row of each
    /// object that has a mask.
    pub warnings: Vec<(u32, Warning)>,
}

/// The score of a row in the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rescore {
    /// The score of the input row.
    #[default]
    Keep,
    /// 1 − MVE of the row's output pose; 0 for a row without an MVE.
    Mve,
    /// The probability that the row's output pose is right; 0 for a row without one.
    Confidence,
}

impl FrameResult {
    /// Writes the poses, the scores and the time of an image into the given rows.
    ///
    /// All rows of the image get the same time: the largest time stated by them plus the time of
    /// the refinement. If `timed` is false, the time becomes unknown, so that equal inputs give
    /// equal bytes. Indices beyond `rows` are ignored.
    pub fn enter(&self, rows: &mut [ResultRow], rescore: Rescore, timed: bool) {
        let own = self
            .rows
            .iter()
            .filter_map(|refined| rows.get(refined.index));
        let stated = own.filter_map(|row| row.time_s).reduce(f64::max);
        let time_s = match self.seconds {
            _ if !timed => None,
            Some(seconds) => Some(stated.unwrap_or(0.0) + seconds),
            None => stated,
        };
        for refined in &self.rows {
            let Some(row) = rows.get_mut(refined.index) else {
                continue;
            };
            row.time_s = time_s;
            if let Some(pose) = refined.pose {
                row.set_camera_from_object(pose);
            }
            match rescore {
                Rescore::Keep => {}
                Rescore::Mve => row.score = refined.mve.map_or(0.0, |(_, mve)| 1.0 - mve),
                Rescore::Confidence => row.score = refined.confidence.unwrap_or(0.0),
            }
        }
    }

    /// Returns rows with the alternatives of each row, best first.
    ///
    /// `rows` are those of [`Self::enter`]. At most `count` rows are returned for each. Their score
    /// is the lowest of the refined rows of the object, minus their gap. An evaluation that keeps
    /// the best poses of an object therefore prefers the refined rows to their alternatives.
    pub fn alternatives(
        &self,
        rows: &[ResultRow],
        count: usize,
    ) -> impl Iterator<Item = ResultRow> {
        let mut lowest: BTreeMap<u32, f64> = BTreeMap::new();
        for refined in self.rows.iter().filter(|refined| refined.pose.is_some()) {
            if let Some(row) = rows.get(refined.index) {
                let score = lowest.entry(row.obj_id).or_insert(row.score);
                *score = score.min(row.score);
            }
        }
        self.rows.iter().flat_map(move |refined| {
            let row = rows.get(refined.index);
            let lowest = row.and_then(|row| lowest.get(&row.obj_id).copied());
            let others = refined.alternatives.iter().take(count);
            row.into_iter().flat_map(move |row| {
                others.clone().map(move |other| {
                    let mut row = row.clone();
                    row.set_camera_from_object(other.camera_from_object);
                    row.score = lowest.unwrap_or(row.score) - other.gap.max(0.0);
                    row
                })
            })
        })
    }
}
