//! Images in NumPy arrays.

use std::path::Path;

use super::raster::{Raster, check_size};
use crate::error::IoError;
use crate::limits::ReadLimits;
use crate::npy::Array;
use crate::number::narrow;

/// The names of arrays that are preferred in an NPZ archive.
const NAMES: [&str; 5] = ["depth", "mask", "image", "data", "arr_0"];

/// Decodes an array of the shape (height, width), with an optional last axis of channels.
pub(super) fn decode(limits: &ReadLimits, path: &Path, content: &[u8]) -> Result<Raster, IoError> {
    let array = Array::parse(limits, path, content, &NAMES)?;
    // A single image may have an axis of length 1 in front.
    let shape = match array.shape[..] {
        [1, ref shape @ ..] if shape.len() >= 2 && shape[0] > 1 => shape,
        ref shape => shape,
    };
    let (height, width, channels) = match *shape {
        [height, width] => (height, width, 1),
        [height, width, channels @ 1..=4] => (height, width, channels),
        _ => {
            let found = format!("an array of the shape {shape:?}");
            return Err(IoError::new(path, None, found, "the shape (height, width)"));
        }
    };
    let (size, raw) = ((width as u64, height as u64), array.raw_bytes() as u64);
    let size = check_size(limits, (path, 0), size, raw, raw)?;
    let samples = array.numbers().map(narrow).collect();
    Ok(Raster {
        channels,
        has_alpha: channels % 2 == 0,
        ..Raster::gray(size, array.integer_bits(), samples)
    })
}
