//! PGM images (integers) and PFM images (floating point).

use std::path::Path;

use super::raster::{Raster, check_size};
use crate::error::{IoError, Place, quote};
use crate::limits::ReadLimits;
use crate::number::{F32, Kind, NumberType, narrow};

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
    if float && last.abs() != 1.0 {
        let found = format!("the scale {last}");
        let expected = "1 or -1: multiply the numbers yourself";
        return Err(IoError::new(path, Place::Byte(2), found, expected));
    }
    let number = match float {
        true => F32,
        false => NumberType::new(Kind::Unsigned, 1 + usize::from(last > 255.0)),
    };
    let needed = width
        .saturating_mul(height)
        .saturating_mul((number.bytes * channels) as u64);
    let size = check_size(limits, (path, 0), (width, height), needed, u64::MAX)?;
    // A single white space ends the header.
    let body = rest.get(1..).unwrap_or_default();
    let (count, available) = (width * height, body.len() as u64);
    IoError::check_promise(path, Place::Byte(2), (count, "pixels"), needed, available)?;
    // The product is at most the size of the file.
    let body = &body[..usize::try_from(needed).unwrap_or(0)];
    // A negative scale of a PFM image means that the numbers are little-endian.
    let big_endian = !float || last > 0.0;
    let sample = |bytes: &[u8]| number.read(bytes, big_endian).map_or(f32::NAN, narrow);
    let rows = body.chunks_exact(number.bytes * size.0 as usize * channels);
    let mut rows: Vec<_> = rows.collect();
    if float {
        // The last row comes first.
        rows.reverse();
    }
    let samples = rows.iter().flat_map(|row| row.chunks_exact(number.bytes));
    let samples = samples.map(sample).collect();
    let integer_bits = (!float).then_some(if number.bytes == 1 { 8 } else { 16 });
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
