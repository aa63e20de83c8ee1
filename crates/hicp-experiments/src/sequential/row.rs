//! The rows of a sequential study: one per trajectory, underlying pipeline and method.

use std::path::Path;

use hicp_io::ReadLimits;

use super::config::TrajectoryConfig;
use crate::error::ExperimentError;
use crate::stored::{Order, Places, check_bin, count_in_order, each_record, measure, number, vsd};

/// The columns of `trajectories.csv`, in order.
pub const TRAJECTORY_COLUMNS: [&str; 11] = [
    "object",
    "trajectory",
    "bin",
    "underlying",
    "method",
    "vsd_initial",
    "vsd_final",
    "add_final_mm",
    "n_estimates",
    "mahalanobis_squared",
    "note",
];

/// What a method made of one trajectory with an underlying pipeline.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryRow {
    /// Name of the object.
    pub object: String,
    /// Index of the trajectory among those of its object.
    pub trajectory: u64,
    /// Bin of the initial VSD, from 0; `None` when there is no trajectory.
    pub bin: Option<usize>,
    /// Name of the underlying pipeline.
    pub underlying: String,
    /// Name of the method; see [`crate::FusionRule::name`].
    pub method: String,
    /// What was measured; `None` when the trajectory could not be made.
    pub(crate) measured: Option<Travelled>,
    /// Why not; empty otherwise.
    pub note: String,
}

/// The figures of a row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Travelled {
    /// Mean VSD of the start against the truth in the first camera frame, with the original model.
    pub(crate) vsd_initial: f64,
    /// Mean VSD of the fused pose where the path ends.
    pub(crate) vsd_final: f64,
    /// Its ADD, or ADI where symmetries are declared, millimetres.
    pub(crate) add_final_mm: f64,
    /// Number of estimates along the way.
    pub(crate) n_estimates: usize,
    /// ξᵀΣ⁻¹ξ of the fused pose's error by the covariance that the method states; `None` without an estimate, and for an object
    /// that looks the same however it is turned about an axis.
    pub(crate) mahalanobis_squared: Option<f64>,
}

impl TrajectoryRow {
    /// Mean VSD of the start and of the fused pose at the end; `None` when the trajectory could not be made.
    #[must_use]
    pub fn vsd(&self) -> Option<(f64, f64)> {
        let measured = self.measured.as_ref()?;
        Some((measured.vsd_initial, measured.vsd_final))
    }

    /// Number of estimates along the way; 0 when the trajectory could not be made.
    #[must_use]
    pub fn n_estimates(&self) -> usize {
        self.measured.as_ref().map_or(0, |m| m.n_estimates)
    }

    /// Squared Mahalanobis distance of the final pose from the truth by the stated covariance, distributed like χ²₆ where that is
    /// right; `None` without an estimate, and for an object that looks the same however it is turned about an axis.
    #[must_use]
    pub fn mahalanobis_squared(&self) -> Option<f64> {
        self.measured.as_ref()?.mahalanobis_squared
    }

    /// The fields in the order of [`TRAJECTORY_COLUMNS`], numbers with a fixed number of digits.
    pub(crate) fn fields(&self) -> [String; 11] {
        let m = self.measured.as_ref();
        let number = |digits: usize, value: Option<f64>| {
            value.map_or_else(String::new, |x| format!("{x:.digits$}"))
        };
        [
            self.object.clone(),
            self.trajectory.to_string(),
            self.bin.map_or_else(String::new, |b| b.to_string()),
            self.underlying.clone(),
            self.method.clone(),
            number(6, m.map(|m| m.vsd_initial)),
            number(6, m.map(|m| m.vsd_final)),
            number(4, m.map(|m| m.add_final_mm)),
            m.map_or_else(String::new, |m| m.n_estimates.to_string()),
            number(4, m.and_then(|m| m.mahalanobis_squared)),
            self.note.clone(),
        ]
    }

    /// Reads a row back; the error says which field is wrong.
    fn parse(record: &csv::StringRecord) -> Result<Self, String> {
        const COLUMNS: [&str; 11] = TRAJECTORY_COLUMNS;
        if record.len() != TRAJECTORY_COLUMNS.len() {
            return Err(format!(
                "{} fields, expected {}",
                record.len(),
                TRAJECTORY_COLUMNS.len()
            ));
        }
        let measured = if record[8].is_empty() {
            None
        } else {
            Some(Travelled {
                vsd_initial: vsd(COLUMNS[5], &record[5])?,
                vsd_final: vsd(COLUMNS[6], &record[6])?,
                add_final_mm: measure(COLUMNS[7], &record[7])?,
                n_estimates: number(COLUMNS[8], &record[8])?,
                mahalanobis_squared: if record[9].is_empty() {
                    None
                } else {
                    Some(measure(COLUMNS[9], &record[9])?)
                },
            })
        };
        Ok(Self {
            object: record[0].to_owned(),
            trajectory: number(COLUMNS[1], &record[1])?,
            bin: if record[2].is_empty() {
                None
            } else {
                Some(number(COLUMNS[2], &record[2])?)
            },
            underlying: record[3].to_owned(),
            method: record[4].to_owned(),
            measured,
            note: record[10].to_owned(),
        })
    }
}

/// Returns rows as CSV, without a header.
pub(crate) fn to_csv(rows: impl IntoIterator<Item = [String; 11]>) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        // A vector takes everything.
        let _ = writer.write_record(&row);
    }
    writer.into_inner().unwrap_or_default()
}

/// Returns the header line.
pub(crate) fn header() -> Vec<u8> {
    to_csv([TRAJECTORY_COLUMNS.map(str::to_owned)])
}

/// Reads the rows of a study from a file.
pub(crate) fn read(
    limits: &ReadLimits,
    path: &Path,
    config: &TrajectoryConfig,
) -> Result<Vec<TrajectoryRow>, ExperimentError> {
    let mut rows = Vec::new();
    let text = limits.read_text(path)?;
    each(limits, path, &text, config, |row, _| {
        rows.push(row);
        Ok(())
    })?;
    Ok(rows)
}

/// Counts the rows that a run is to go on with; others than the first ones of the study are refused.
pub(crate) fn count(
    limits: &ReadLimits,
    path: &Path,
    text: &str,
    config: &TrajectoryConfig,
) -> Result<u64, ExperimentError> {
    let mut rows = 0;
    each(limits, path, text, config, |_, place| {
        count_in_order(&mut rows, place)
    })?;
    Ok(rows)
}

/// Reads the rows of a study from the text of a file; those that the study cannot have are refused.
fn each(
    limits: &ReadLimits,
    path: &Path,
    text: &str,
    config: &TrajectoryConfig,
    mut take: impl FnMut(TrajectoryRow, u64) -> Result<(), String>,
) -> Result<(), ExperimentError> {
    let underlying = config.underlying.iter();
    let columns = [
        ("object", config.objects.iter().map(|o| &*o.name).collect()),
        ("underlying", underlying.map(|u| &*u.name).collect()),
        ("method", config.methods.iter().map(|m| &**m).collect()),
    ];
    let bins = config.bins.max(1) as u64;
    let trajectories = config.trajectories.saturating_mul(bins);
    let mut places = Places::new(columns, ("trajectory", trajectories), Order::Cases);
    each_record(path, text, &header(), limits.max_rows, |record| {
        let row = TrajectoryRow::parse(record)?;
        let (_, place) =
            places.take([&row.object, &row.underlying, &row.method], row.trajectory)?;
        let bin = usize::try_from(row.trajectory % bins).ok();
        check_bin(row.bin, bin, row.measured.is_some())?;
        take(row, place)
    })
}
