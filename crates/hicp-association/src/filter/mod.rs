//! Outlier filters and weights: the kept pairs, and the influence of each.

pub(crate) mod boundary_targets;
pub(crate) mod max_distance;
pub(crate) mod max_normal_angle;
pub(crate) mod min_pairs;
pub(crate) mod one_to_one;
pub(crate) mod outlier_filter;
pub(crate) mod quantile;
pub(crate) mod schedule;
pub(crate) mod weight;

pub use boundary_targets::BoundaryTargets;
pub use max_distance::MaxDistance;
pub use max_normal_angle::MaxNormalAngle;
pub use min_pairs::MinPairs;
pub use one_to_one::OneToOne;
pub use outlier_filter::OutlierFilter;
pub use quantile::{MadDistance, MedianDistance, Trimmed, VarTrimmed};
pub use schedule::Schedule;
pub use weight::{ConstantWeight, DistanceWeight, NormalWeight, SensorNoise, SensorNoiseWeight};
