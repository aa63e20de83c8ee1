//! What a refinement of rows returns, and how it is entered into the file's rows.

use hicp_io::bop::ResultRow;
use hybrid_icp::core::{Isometry3, UnitQuaternion};
use hybrid_icp::score::Flatness;
use hybrid_icp::{Warning, warnings_of_result};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

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
    #[serde(serialize_with = "write_pose", deserialize_with = "read_pose")]
    pub pose: Option<Isometry3<f64>>,
    /// MVE of the row's pose and of the result's; `None` if it did not get as far as the pipeline.
    pub mve: Option<(f64, f64)>,
    /// How flat the surfaces are at the result's pose ([`hybrid_icp::Refinement::flatness`]).
    pub flatness: Option<Flatness>,
}

impl RowResult {
    /// Returns why the pose is not to be trusted ([`hybrid_icp::warnings_of_result`]); nothing where no score says so, or there is none.
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        match self.mve {
            Some((before, after)) => warnings_of_result(before, after, self.flatness),
            None => Vec::new(),
        }
    }

    /// A row that did not get as far as the pipeline.
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
    /// Spent on its rows, seconds; `None` if none got as far as the pipeline.
    pub seconds: Option<f64>,
    /// Files that were missing or damaged.
    pub faults: Vec<Fault>,
    /// What looks wrong about the inputs ([`hybrid_icp::warnings`]), by object: of the first row of each that got as far as a mask.
    pub warnings: Vec<(u32, Warning)>,
}

/// What becomes the score of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rescore {
    /// The row's own score.
    #[default]
    Keep,
    /// 1 − MVE of the row's pose in the output; 0 for a row without an MVE.
    Mve,
}

impl FrameResult {
    /// Enters the poses, scores and the time of an image, the same for all of its rows, into the rows that were given.
    ///
    /// The time is added to the largest that these rows state; `timed` false writes it as unknown, so that the same input
    /// gives the same bytes. Places beyond `rows` are ignored.
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

/// Translation and quaternion (i, j, k, w) of a pose.
type PoseParts = ([f64; 3], [f64; 4]);

fn write_pose<S: Serializer>(pose: &Option<Isometry3<f64>>, to: S) -> Result<S::Ok, S::Error> {
    let parts: Option<PoseParts> =
        pose.map(|pose| (pose.translation.vector.into(), pose.rotation.coords.into()));
    parts.serialize(to)
}

fn read_pose<'a, D: Deserializer<'a>>(from: D) -> Result<Option<Isometry3<f64>>, D::Error> {
    let parts = Option::<PoseParts>::deserialize(from)?;
    // Normalizing the quaternion again would change its last bits.
    let rotation = |q: [f64; 4]| UnitQuaternion::new_unchecked(q.into());
    Ok(parts.map(|(t, q)| Isometry3::from_parts(t.into(), rotation(q))))
}
