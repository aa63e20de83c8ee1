//! The agreement of a model's colors with a color image.

mod agreement;
mod cells;
mod sampled;

pub use agreement::ColorAgreement;
pub use cells::{ColorEvidence, Shading};
pub use sampled::SampledColor;
