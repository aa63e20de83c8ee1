//! Reading and writing of images in PNG files.

mod depth;
mod mask;
mod pixels;
mod rgb;

pub use depth::{read_depth_png, write_depth_png};
pub use mask::{read_mask_png, write_mask_png};
pub use pixels::read_png_size;
pub use rgb::{read_rgb_png, write_rgb_png};
