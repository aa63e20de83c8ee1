//! The result of refining the rows of an image, and entering it into the rows of the file.

use hicp_io::bop::ResultRow;
use hybrid_icp::core::Isometry3;
use hybrid_icp::score::Flatness;
use hybrid_icp::{Warning, warnings_of_result};
use serde::{Deserialize, Serialize};

use crate::fault::Fault;
use crate::row_status::RowStatus;

/// The result of a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RowResult {
    /// Its place among the rows that were given.
    pub index: usize,
    /// Its status.
    pub status: RowStatus,
    /// `camera_from_object` in meters, if it differs from the row's.
    pub pose: Option<Isometry3<f64>>,
    /// MVE of the row's pose and of the result's pose; `None` if the row did not reach the pipeline.
    pub mve: Option<(f64, f64)>,
    /// How flat the surfaces are at the result's pose ([`hybrid_icp::Refinement::flatness`]).
    pub flatness: Option<Flatness>,
}

impl RowResult {
    /// Returns the reasons not to trust the pose ([`hybrid_icp::warnings_of_result`]); none without an MVE.
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        match self.mve {
            Some((before, after)) => warnings_of_result(before, after, self.flatness),
            None => Vec::new(),
        }
    }

    /// Creates the result of a row that did not reach the pipeline.
    #[must_use]
    pub fn unrefined(index: usize, status: RowStatus) -> Self {
        Self {
            index,
            status,
            pose: None,
            mve: None,
            flatness: None,
        }
    }
}

/// All rows of an image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameResult {
    /// One per row, in the order of the rows.
    pub rows: Vec<RowResult>,
    /// Seconds spent on its rows; `None` if none reached the pipeline.
    pub seconds: Option<f64>,
    /// Files that were missing or damaged.
    pub faults: Vec<Fault>,
    /// Warnings about the inputs ([`hybrid_icp::warnings`]) by object, from the first row of each object that has a mask.
    pub warnings: Vec<(u32, Warning)>,
}

/// The score of a row in the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rescore {
    /// The row's own score.
    #[default]
    Keep,
    /// 1 − MVE of the row's pose in the output; 0 for a row without an MVE.
    Mve,
}

impl FrameResult {
    /// Enters the poses, scores and the time of an image, which is the same for all of its rows, into the given rows.
    ///
    /// The time is added to the largest time of these rows. If `timed` is false, the time is unknown, so that the same input
    /// gives the same bytes. Indices beyond `rows` are ignored.
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
            if rescore == Rescore::Mve {
                row.score = refined.mve.map_or(0.0, |(_, mve)| 1.0 - mve);
            }
        }
    }
}
