//! The evidence for and against a pose, and the trust that it deserves.

pub(crate) mod calibration;
pub(crate) mod confidence;
pub(crate) mod doubt;
pub(crate) mod evidence;
pub(crate) mod flatness;
pub(crate) mod grid;
pub(crate) mod insides;
pub(crate) mod median;
pub(crate) mod misfit;
pub(crate) mod network;

pub use calibration::{LabeledScore, ReliabilityBin, reliability, roc_area};
pub use confidence::Confidence;
pub use doubt::Doubt;
pub use evidence::Evidence;
pub use flatness::Flatness;
pub use misfit::Misfit;
pub use network::N_FEATURES;
