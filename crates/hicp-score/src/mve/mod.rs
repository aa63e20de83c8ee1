//! The mean VSD estimate: a score of a pose against the live image.

pub(crate) mod agreement;
pub(crate) mod cells;
pub(crate) mod coarse_grid;
pub(crate) mod distances;
pub(crate) mod mask_trust;
pub(crate) mod mean_vsd;
pub(crate) mod occlusion;
pub(crate) mod sampled_mve;
mod splat;
pub(crate) mod surfaces;
pub(crate) mod trust_map;

pub use mask_trust::MaskTrust;
pub use mean_vsd::MeanVsd;
pub use occlusion::{Occlusion, VISIBILITY_TOLERANCE_METERS};
pub use sampled_mve::SampledMve;
