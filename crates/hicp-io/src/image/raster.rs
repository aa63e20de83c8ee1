//! Decoded images of every format, before their samples become depths or a mask.

use std::path::Path;

use hicp_core::MAX_IMAGE_SIDE;

use crate::error::{IoError, Place};
use crate::limits::{Limit, ReadLimits};

/// The samples of an image, as stored.
#[derive(Debug)]
pub(super) struct Raster {
    pub(super) width: u32,
    pub(super) height: u32,
    /// The number of samples per pixel.
    pub(super) channels: usize,
    /// Whether the last sample of a pixel is its opacity.
    pub(super) has_alpha: bool,
    /// The bits of an integer sample, or `None` for floating point.
    pub(super) integer_bits: Option<u32>,
    /// For a palette: whether an index is black or transparent, if its colors are read.
    pub(super) background: Option<Vec<bool>>,
    /// The samples, row by row and pixel by pixel.
    pub(super) samples: Vec<f32>,
}

impl Raster {
    /// Creates an image of one sample per pixel.
    pub(super) fn gray(
        (width, height): (u32, u32),
        integer_bits: Option<u32>,
        samples: Vec<f32>,
    ) -> Self {
        Self {
            width,
            height,
            channels: 1,
            has_alpha: false,
            integer_bits,
            background: None,
            samples,
        }
    }
}

/// The largest number of bytes that one byte of a supported compression becomes.
const MAX_COMPRESSION: u64 = 2048;

/// Returns an error for an image that is too large, or larger than its file can hold.
///
/// Decoders call it before they allocate memory. `byte` is the place of the size in the file, and
/// `raw_bytes` the size of the samples.
pub(super) fn check_size(
    limits: &ReadLimits,
    (path, byte): (&Path, u64),
    (width, height): (u64, u64),
    raw_bytes: u64,
    available: u64,
) -> Result<(u32, u32), IoError> {
    let (place, found) = (Place::Byte(byte), format!("{width}x{height} pixels"));
    if width.min(height) == 0 || width.max(height) > u64::from(MAX_IMAGE_SIDE) {
        let expected = format!("sides of 1 to {MAX_IMAGE_SIDE}");
        return Err(IoError::new(path, place, found, expected));
    }
    let count = width * height;
    let within = limits.check(Limit::PIXELS, path, place.clone(), count);
    within.map_err(|mut error| {
        error.found = found;
        error
    })?;
    let needed = raw_bytes / MAX_COMPRESSION;
    IoError::check_promise(path, place, (count, "pixels"), needed, available)?;
    // Both are at most MAX_IMAGE_SIDE.
    let side = |side| u32::try_from(side).unwrap_or(MAX_IMAGE_SIDE);
    Ok((side(width), side(height)))
}

/// Unpacks samples of 1, 2, 4 or 8 bits, whose rows start at whole bytes.
pub(super) fn unpack(bytes: &[u8], row_samples: usize, bits: usize) -> Vec<f32> {
    if bits == 8 {
        return bytes.iter().map(|byte| f32::from(*byte)).collect();
    }
    let row_bytes = (row_samples * bits).div_ceil(8).max(1);
    let sample = |row: &[u8], index: usize| {
        let shift = 8 - bits - index * bits % 8;
        f32::from((row[index * bits / 8] >> shift) & (0xff >> (8 - bits)))
    };
    let rows = bytes.chunks_exact(row_bytes);
    rows.flat_map(|row| (0..row_samples).map(move |index| sample(row, index)))
        .collect()
}
