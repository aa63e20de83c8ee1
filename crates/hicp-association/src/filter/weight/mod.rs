//! Weights: the influence of each pair.

mod constant_weight;
mod distance_weight;
mod normal_weight;
mod sensor_noise_weight;

pub use constant_weight::ConstantWeight;
pub use distance_weight::DistanceWeight;
pub use normal_weight::NormalWeight;
pub use sensor_noise_weight::{SensorNoise, SensorNoiseWeight};
