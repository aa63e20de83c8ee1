//! Filters whose limit follows from the distances of all pairs.

pub(crate) mod distances;
mod mad_distance;
mod median_distance;
mod trimmed;
mod var_trimmed;

pub use mad_distance::MadDistance;
pub use median_distance::MedianDistance;
pub use trimmed::Trimmed;
pub use var_trimmed::VarTrimmed;
