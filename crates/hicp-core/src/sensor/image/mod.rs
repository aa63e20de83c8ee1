//! Depth images, distance images, color images and masks, as separate types so that they cannot be
//! swapped.
//!
//! All are row-major with index `v * width + u`. Lengths are in meters; 0 means that nothing was
//! measured.

mod color;
mod depth;
mod error;
mod mask;
mod raster;

pub use color::ColorImage;
pub use depth::{DepthImage, DistanceImage, MAX_DEPTH_METERS, MIN_DEPTH_METERS};
pub use error::{ImageError, check_size};
pub use mask::Mask;
