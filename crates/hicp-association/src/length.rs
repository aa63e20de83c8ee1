//! Lengths that are absolute or scale with the object.

use hicp_core::Model;

/// A length in metres, or as a fraction of the model's diameter so that one value fits objects of any size.
///
/// Any value is valid: a component says what it makes of negative lengths and NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// Metres.
    Meters(f32),
    /// A fraction of [`Model::diameter`].
    Diameters(f32),
}

impl Length {
    /// Returns the length in metres for a model.
    #[must_use]
    pub fn meters(self, model: &Model) -> f32 {
        match self {
            Self::Meters(length) => length,
            #[allow(clippy::cast_possible_truncation)] // f32 is the precision of buffers.
            Self::Diameters(fraction) => fraction * model.diameter() as f32,
        }
    }
}
