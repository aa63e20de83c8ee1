//! Lengths that are absolute or scale with the object.

use hicp_core::Problem;

/// A length in metres, or as a fraction of the model's diameter so that one value fits objects of any size.
///
/// Any value is valid: a component says what it makes of negative lengths and NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// Metres.
    Meters(f32),
    /// A fraction of the model's diameter.
    Diameters(f32),
}

impl Length {
    /// Returns the length in meters for a problem; NaN for a fraction of the diameter if the problem has no model.
    ///
    /// No distance is within NaN: a gate that is undefined keeps nothing.
    #[must_use]
    pub fn meters(self, problem: &Problem<'_>) -> f32 {
        match self {
            Self::Meters(length) => length,
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
            Self::Diameters(fraction) => problem
                .model()
                .map_or(f32::NAN, |model| fraction * model.diameter() as f32),
        }
    }
}
