//! Lengths in meters or relative to the object.

use hicp_core::Problem;

/// A length in meters, or as a fraction of the diameter of the model or source cloud.
///
/// A fraction fits objects of any size. Any value is valid: each component defines the meaning of
/// negative lengths and NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// A length in meters.
    Meters(f64),
    /// A fraction of the diameter of the model or source cloud.
    Diameters(f64),
}

impl Length {
    /// Returns the length in meters for a problem.
    ///
    /// If the problem has no source, a fraction of the diameter is NaN. Distances are never within
    /// NaN, so an undefined gate rejects everything.
    #[must_use]
    pub fn meters(self, problem: &Problem<'_>) -> f32 {
        match self {
            Self::Meters(length) => narrow(length),
            Self::Diameters(fraction) => problem.source().map_or(f32::NAN, |source| {
                narrow(fraction) * narrow(source.diameter())
            }),
        }
    }
}

/// Rounds a parameter to the precision of buffers.
#[allow(clippy::cast_possible_truncation)]
pub(crate) fn narrow(parameter: f64) -> f32 {
    parameter as f32
}
