//! Figures without intervals.

use super::interval::quantile;
use super::metric::ADD_SHARE;
use crate::study::Measured;

/// Figures of a variant in a group, without intervals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Number of rows.
    pub count: usize,
    /// Mean VSD of the initial poses.
    pub vsd_initial: f64,
    /// Median ADD(-S), millimeters.
    pub add_median_mm: f64,
    /// Share of rows whose ADD(-S) is below [`ADD_SHARE`] of the diameter.
    pub add_success: f64,
    /// Mean number of iterations, or of estimates along a trajectory.
    pub steps: f64,
    /// Standard deviation of the processor time, milliseconds. `None` without times.
    pub cpu_deviation_ms: Option<f64>,
}

impl Cell {
    /// Averages rows, each with the diameter of its object in millimeters.
    ///
    /// If there are no rows, returns `None`.
    pub(super) fn of(rows: &[(f64, &Measured)]) -> Option<Self> {
        let count = rows.len() as f64;
        let mean = |value: &dyn Fn(f64, &Measured) -> f64| {
            let sum: f64 = rows.iter().map(|(diameter, m)| value(*diameter, m)).sum();
            sum / count
        };
        let mut errors: Vec<f64> = rows.iter().map(|(_, m)| m.add_final_mm).collect();
        errors.sort_by(f64::total_cmp);
        let times: Option<Vec<f64>> = rows.iter().map(|(_, m)| m.cpu_ms).collect();
        let deviation = |times: Vec<f64>| {
            let mean = times.iter().sum::<f64>() / count;
            let squares: f64 = times.iter().map(|t| (t - mean).powi(2)).sum();
            (squares / (count - 1.0).max(1.0)).sqrt()
        };
        let is_success = |diameter, m: &Measured| m.add_final_mm < ADD_SHARE * diameter;
        Some(Self {
            count: rows.len(),
            vsd_initial: mean(&|_, m| m.vsd_initial),
            add_median_mm: quantile(&errors, 0.5)?,
            add_success: mean(&|diameter, m| f64::from(u8::from(is_success(diameter, m)))),
            steps: mean(&|_, m| m.steps as f64),
            cpu_deviation_ms: times.map(deviation),
        })
    }
}
