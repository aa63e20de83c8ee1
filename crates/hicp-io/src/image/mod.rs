//! Reading and writing of images: color, depth, masks and pictures.

mod bmp;
pub(crate) mod color;
mod decode;
mod depth;
#[cfg(feature = "exr")]
mod exr;
#[cfg(feature = "jpeg")]
mod jpeg;
mod mask;
mod mask_values;
mod netpbm;
#[cfg(feature = "npy")]
mod npy;
mod pixels;
mod raster;
#[cfg(feature = "tiff")]
mod tiff;

pub use color::{read_color, write_rgb_png};
pub use depth::{RawDepth, read_depth, read_depth_png, write_depth_png};
pub use mask::{read_mask_png, write_mask_png};
pub use mask_values::{MaskFile, MaskRule, read_mask};
pub use pixels::read_png_size;
