//! Depth sensors and their errors.

mod depth_sensor;
mod distortion;
mod noise;

pub use depth_sensor::{DepthSensor, Dropout};
pub use distortion::{DEPTH_EDGE_METERS, Distortion};
pub use noise::{DepthNoise, RelativeGaussian};
