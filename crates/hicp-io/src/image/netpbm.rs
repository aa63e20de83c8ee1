//! PGM images (integers) and PFM images (floating point).

use std::path::Path;

use super::raster::{Raster, check_size};
use crate::error::{IoError, Place, quote};
use crate::limits::ReadLimits;

/// Decodes a binary PGM (`P5`) or PFM (`Pf`, `PF`) image.
pub(super) fn decode(limits: &ReadLimits, path: &Path, content: &[u8]) -> Result<Raster, IoError> {
    let mut rest = &content[2..];
    let [width, height, last] = [(); 3].map(|()| word(&mut rest));
    let header = || -> Option<(u64, u64, f64)> {
        Some((
            width?.parse().ok()?,
            height?.parse().ok()?,
            last?.parse().ok()?,
        ))
    };
    let float = !content.starts_with(b"P5");
    let channels = 1 + 2 * usize::from(content.starts_with(b"PF"));
    let Some((width, height, last)) = header().filter(|(.., last)| {
        last.is_finite() && *last != 0.0 && (float || (1.0..=65535.0).contains(last))
    }) else {
        let start = quote(&String::from_utf8_lossy(&content[..content.len().min(60)]));
        let expected = "a header of the width, the height and the largest value or the scale";
        return Err(IoError::new(path, Place::Byte(2), start, expected));
    };
    let bytes = if float {
        4
    } else {
        1 + u64::from(last > 255.0)
    };
    let needed = width
        .saturating_mul(height)
        .saturating_mul(bytes * channels as u64);
    let size = check_size(limits, (path, 0), (width, height), needed, u64::MAX)?;
    // A single white space ends the header.
    let body = rest.get(1..).unwrap_or_default();
    let (count, available) = (width * height, body.len() as u64);
    IoError::check_promise(path, Place::Byte(2), (count, "pixels"), needed, available)?;
    // The product is at most the size of the file.
    let body = &body[..usize::try_from(needed).unwrap_or(0)];
    let samples = match (float, bytes) {
        (true, _) => {
            let sample = |b: &[u8]| match last < 0.0 {
                true => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
                false => f32::from_be_bytes([b[0], b[1], b[2], b[3]]),
            };
            // The last row comes first.
            let rows = body.chunks_exact(4 * size.0 as usize * channels).rev();
            rows.flat_map(|row| row.chunks_exact(4).map(sample))
                .collect()
        }
        (false, 1) => body.iter().map(|byte| f32::from(*byte)).collect(),
        _ => {
            let pairs = body.chunks_exact(2);
            pairs
                .map(|b| f32::from(u16::from_be_bytes([b[0], b[1]])))
                .collect()
        }
    };
    let integer_bits = (!float).then_some(if bytes == 1 { 8 } else { 16 });
    Ok(Raster {
        channels,
        ..Raster::gray(size, integer_bits, samples)
    })
}

/// Removes the next word of a header, after white space and comments.
fn word<'a>(rest: &mut &'a [u8]) -> Option<&'a str> {
    loop {
        *rest = rest.trim_ascii_start();
        match rest.strip_prefix(b"#") {
            None => break,
            Some(comment) => *rest = &comment[comment.iter().position(|b| *b == b'\n')?..],
        }
    }
    let end = rest.iter().position(u8::is_ascii_whitespace)?;
    let (word, after) = rest.split_at(end);
    *rest = after;
    std::str::from_utf8(word).ok()
}
