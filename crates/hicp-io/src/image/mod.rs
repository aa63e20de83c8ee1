//! Reading and writing of images: depth, masks and pictures.

mod bmp;
mod decode;
mod depth;
#[cfg(feature = "exr")]
mod exr;
mod mask;
mod mask_values;
mod netpbm;
#[cfg(feature = "npy")]
mod npy;
mod pixels;
mod raster;
mod rgb;
#[cfg(feature = "tiff")]
mod tiff;

pub use depth::{RawDepth, read_depth, read_depth_png, write_depth_png};
pub use mask::{read_mask_png, write_mask_png};
pub use mask_values::{MaskFile, MaskRule, read_mask};
pub use pixels::read_png_size;
pub use rgb::{read_rgb_png, write_rgb_png};
