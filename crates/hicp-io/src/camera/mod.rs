//! Reading of cameras.

mod bop;
mod distortion;
mod forms;
mod model;
mod register;

pub(crate) use bop::CameraRecord;
pub use bop::{CameraFile, read_camera_json};
pub use distortion::Distortion;
pub use forms::read_camera;
pub use register::register_depth;
