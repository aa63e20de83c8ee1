//! Outlier filters and weights: the kept pairs, and the influence of each.

pub(crate) mod boundary_targets;
pub(crate) mod constant_weight;
pub(crate) mod distance_weight;
pub(crate) mod distances;
pub(crate) mod mad_distance;
pub(crate) mod max_distance;
pub(crate) mod max_normal_angle;
pub(crate) mod median_distance;
pub(crate) mod min_pairs;
pub(crate) mod normal_weight;
pub(crate) mod one_to_one;
pub(crate) mod outlier_filter;
pub(crate) mod schedule;
pub(crate) mod sensor_noise_weight;
pub(crate) mod trimmed;
pub(crate) mod var_trimmed;

pub use boundary_targets::BoundaryTargets;
pub use constant_weight::ConstantWeight;
pub use distance_weight::DistanceWeight;
pub use mad_distance::MadDistance;
pub use max_distance::MaxDistance;
pub use max_normal_angle::MaxNormalAngle;
pub use median_distance::MedianDistance;
pub use min_pairs::MinPairs;
pub use normal_weight::NormalWeight;
pub use one_to_one::OneToOne;
pub use outlier_filter::OutlierFilter;
pub use schedule::Schedule;
pub use sensor_noise_weight::{SensorNoise, SensorNoiseWeight};
pub use trimmed::Trimmed;
pub use var_trimmed::VarTrimmed;
