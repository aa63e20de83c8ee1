//! BMP images without compression, for masks.
//!
//! This crate has its own parser: one kept crate decodes rows of one bit wrongly and fills
//! truncated files with zeros, and another takes a minute to compile.

use std::path::Path;

use super::raster::{Raster, check_size, unpack};
use crate::error::{IoError, Place};
use crate::limits::ReadLimits;

/// Decodes an uncompressed image of 1, 4, 8, 24 or 32 bits per pixel.
pub(super) fn decode(limits: &ReadLimits, path: &Path, content: &[u8]) -> Result<Raster, IoError> {
    let refuse =
        |byte, found: String, expected| IoError::new(path, Place::Byte(byte), found, expected);
    let number = |at: usize| {
        let bytes = content
            .get(at..at + 4)
            .and_then(|bytes| bytes.try_into().ok());
        bytes.map(i32::from_le_bytes).ok_or_else(|| {
            let found = format!("a header of {} bytes", content.len());
            refuse(0, found, "a BMP header of at least 50 bytes")
        })
    };
    let (start, header, bits) = (number(10)?, number(14)?, number(28)? & 0xffff);
    let (width, height) = (number(18)?, number(22)?);
    let (compression, colors) = (number(30)?, number(46)?);
    let bits = match (bits, compression) {
        (1 | 4 | 8 | 24 | 32, 0) | (32, 3) => bits.unsigned_abs() as usize,
        _ => {
            let found = format!("{bits} bits per pixel with compression {compression}");
            return Err(refuse(
                28,
                found,
                "1, 4, 8, 24 or 32 bits without compression",
            ));
        }
    };
    // Rows are filled up to four bytes.
    let row_bytes = (u64::from(width.unsigned_abs()) * bits as u64).div_ceil(32) * 4;
    let needed = row_bytes * u64::from(height.unsigned_abs());
    let size = (
        width.max(0).unsigned_abs().into(),
        height.unsigned_abs().into(),
    );
    let size = check_size(limits, (path, 18), size, needed, needed)?;
    let body = usize::try_from(start)
        .ok()
        .and_then(|start| content.get(start..));
    let body = body.unwrap_or_default();
    IoError::check_promise(
        path,
        Place::Byte(18),
        (needed / row_bytes, "rows"),
        needed,
        body.len() as u64,
    )?;
    // Both fit, because the file holds the rows.
    let row_bytes = usize::try_from(row_bytes).unwrap_or(usize::MAX);
    let mut rows: Vec<_> = body.chunks_exact(row_bytes).take(size.1 as usize).collect();
    if height > 0 {
        // The last row comes first.
        rows.reverse();
    }
    if bits <= 8 {
        let palette = usize::try_from(header)
            .ok()
            .and_then(|header| content.get(14 + header..));
        let count = if colors == 0 {
            1 << bits
        } else {
            colors.unsigned_abs().min(256) as usize
        };
        let palette = palette.unwrap_or_default().chunks_exact(4).take(count);
        let used = (size.0 as usize * bits).div_ceil(8);
        let samples = rows
            .iter()
            .flat_map(|row| unpack(&row[..used], size.0 as usize, bits));
        return Ok(Raster {
            background: Some(palette.map(|color| color[..3] == [0; 3]).collect()),
            ..Raster::gray(size, Some(8), samples.collect())
        });
    }
    let channels = bits / 8;
    let pixels = rows
        .iter()
        .flat_map(|row| row.chunks_exact(channels).take(size.0 as usize));
    // Blue comes before green and red.
    let samples = pixels.flat_map(|pixel| {
        let order = [2, 1, 0, 3].into_iter().take(channels);
        order.map(|channel| f32::from(pixel[channel]))
    });
    Ok(Raster {
        channels,
        has_alpha: channels == 4,
        ..Raster::gray(size, Some(8), samples.collect())
    })
}
