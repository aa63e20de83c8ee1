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
        let bytes = content.get(at..).and_then(<[u8]>::first_chunk);
        bytes.copied().map(i32::from_le_bytes).ok_or_else(|| {
            let found = format!("a header of {} bytes", content.len());
            refuse(0, found, "a BMP header of at least 50 bytes")
        })
    };
    let (start, header) = (number(10)?, number(14)?);
    if header < 40 {
        let found = format!("a header of {header} bytes, as of OS/2");
        return Err(refuse(14, found, "one of at least 40 bytes, as of Windows"));
    }
    let bits = number(28)? & 0xffff;
    let (width, height) = (number(18)?, number(22)?);
    let (compression, colors) = (number(30)?, number(46)?);
    let bits = match (bits, compression) {
        (1 | 4 | 8 | 24 | 32, 0) | (32, 3) => bits.unsigned_abs() as usize,
        _ => {
            let found = format!("{bits} bits per pixel with compression {compression}");
            let expected = "1, 4, 8, 24 or 32 bits without compression";
            return Err(refuse(28, found, expected));
        }
    };
    // Rows are filled up to four bytes.
    let row_bytes = (u64::from(width.unsigned_abs()) * bits as u64).div_ceil(32) * 4;
    let needed = row_bytes * u64::from(height.unsigned_abs());
    let size = (width.max(0).unsigned_abs(), height.unsigned_abs());
    let size = (size.0.into(), size.1.into());
    let size = check_size(limits, (path, 18), size, needed, needed)?;
    let after = |start: i32| content.get(usize::try_from(start).ok()?..);
    let body = after(start).unwrap_or_default();
    let (promised, available) = ((needed / row_bytes, "rows"), body.len() as u64);
    IoError::check_promise(path, Place::Byte(18), promised, needed, available)?;
    // Both fit, because the file holds the rows.
    let row_bytes = usize::try_from(row_bytes).unwrap_or(usize::MAX);
    let mut rows: Vec<_> = body.chunks_exact(row_bytes).take(size.1 as usize).collect();
    if height > 0 {
        // The last row comes first.
        rows.reverse();
    }
    if bits <= 8 {
        let palette = after(header).and_then(|rest| rest.get(14..));
        let count = match colors {
            0 => 1 << bits,
            colors => colors.unsigned_abs().min(256) as usize,
        };
        let palette = palette.unwrap_or_default().chunks_exact(4).take(count);
        let used = (size.0 as usize * bits).div_ceil(8);
        let samples = rows
            .iter()
            .map(|row| unpack(&row[..used], size.0 as usize, bits));
        return Ok(Raster {
            background: Some(palette.map(|color| color[..3] == [0; 3]).collect()),
            ..Raster::gray(size, Some(8), samples.flatten().collect())
        });
    }
    let channels = bits / 8;
    let rows = rows.iter().map(|row| row.chunks_exact(channels));
    let pixels = rows.flat_map(|pixels| pixels.take(size.0 as usize));
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
