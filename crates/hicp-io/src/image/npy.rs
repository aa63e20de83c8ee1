//! Images in NumPy arrays.

use std::path::Path;

use super::raster::{Raster, check_size};
use crate::error::IoError;
use crate::limits::ReadLimits;
use crate::npy::Array;
use crate::number::narrow;

/// Decodes an array of the shape (height, width), with an optional last axis of channels.
///
/// Of the arrays of an NPZ archive, the one called `name` comes first.
pub(super) fn decode(
    limits: &ReadLimits,
    path: &Path,
    content: &[u8],
    name: &str,
) -> Result<Raster, IoError> {
    let names = [name, "image", "data", "arr_0"];
    let array = Array::parse(limits, path, content, &names)?;
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
