//! The figures that are averaged.

use crate::study::Measured;

/// A mean VSD above this is a failure.
pub const FAILURE_VSD: f64 = 0.3;
/// A refined pose is worse than the initial one if its mean VSD is higher by more than this.
pub const WORSE_VSD: f64 = 0.02;
/// An ADD(-S) below this share of the diameter is a success, as in the literature on ADD.
pub const ADD_SHARE: f64 = 0.1;

/// A figure of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metric {
    /// Mean VSD of the returned pose.
    Vsd,
    /// 1 if the mean VSD is above [`FAILURE_VSD`], else 0.
    Failure,
    /// Processor time, milliseconds.
    CpuMs,
    /// 1 if the mean VSD exceeds that of the initial pose by more than [`WORSE_VSD`], else 0.
    Worse,
}

impl Metric {
    pub(super) const ALL: [Self; 4] = [Self::Vsd, Self::Failure, Self::CpuMs, Self::Worse];

    /// Returns whether its mean is a share of the rows.
    pub(super) fn is_share(self) -> bool {
        matches!(self, Self::Failure | Self::Worse)
    }

    pub(super) fn of(self, measured: &Measured) -> Option<f64> {
        let (before, after) = (measured.vsd_initial, measured.vsd_final);
        match self {
            Self::Vsd => Some(after),
            Self::Failure => Some(f64::from(u8::from(after > FAILURE_VSD))),
            Self::CpuMs => measured.cpu_ms,
            Self::Worse => Some(f64::from(u8::from(after > before + WORSE_VSD))),
        }
    }
}
