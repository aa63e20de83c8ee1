//! TIFF images: strips or tiles of either byte order, uncompressed, Deflate, LZW or PackBits.

use std::io::Cursor;
use std::path::Path;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::raster::{Raster, check_size, unpack};
use crate::error::IoError;
use crate::limits::ReadLimits;
use crate::number::narrow;

/// Decodes the first image of a TIFF file.
pub(super) fn decode(limits: &ReadLimits, path: &Path, content: &[u8]) -> Result<Raster, IoError> {
    let failed = |error: tiff::TiffError| {
        let found = "data that are not a complete TIFF image";
        let expected = "a TIFF image of numbers, uncompressed or with Deflate, LZW or PackBits";
        IoError::new(path, None, found, expected).with_source(error)
    };
    let mut decoder = Decoder::new(Cursor::new(content)).map_err(failed)?;
    let (width, height) = decoder.dimensions().map_err(failed)?;
    let color = decoder.colortype().map_err(failed)?;
    let (channels, has_alpha) = match color {
        ColorType::Gray(_) | ColorType::Palette(_) => (1, false),
        ColorType::GrayA(_) => (2, true),
        ColorType::RGB(_) => (3, false),
        ColorType::RGBA(_) => (4, true),
        other => {
            let found = format!("{other:?} colors");
            let expected = "gray, RGB or palette colors, with or without alpha";
            return Err(IoError::new(path, None, found, expected));
        }
    };
    let bits = usize::from(color.bit_depth());
    // The decoder ignores the first two. Depth has no white that it could invert.
    for (tag, values, applies, expected) in [
        (Tag::Orientation, 2..=8, true, "an upright image (1)"),
        (
            Tag::PlanarConfiguration,
            2..=2,
            channels > 1,
            "the samples of a pixel together (1)",
        ),
        (
            Tag::PhotometricInterpretation,
            0..=0,
            bits >= 16,
            "black as 0 (1)",
        ),
    ] {
        let value: Option<u16> = decoder.find_tag_unsigned(tag).map_err(failed)?;
        if let Some(value) = value.filter(|value| applies && values.contains(value)) {
            let found = format!("the {tag:?} {value}");
            return Err(IoError::new(path, None, found, expected));
        }
    }
    let row = width as usize * channels;
    let raw = (row * bits).div_ceil(8) as u64 * u64::from(height);
    let size = (u64::from(width), u64::from(height));
    let size = check_size(limits, (path, 0), size, raw, content.len() as u64)?;
    let mut buffers = Limits::default();
    buffers.decoding_buffer_size = usize::try_from(raw).unwrap_or(0).saturating_add(16);
    let image = decoder.with_limits(buffers).read_image().map_err(failed)?;
    let float = matches!(
        image,
        DecodingResult::F16(_) | DecodingResult::F32(_) | DecodingResult::F64(_)
    );
    let samples: Vec<f32> = match image {
        DecodingResult::U8(bytes) if bits < 8 => unpack(&bytes, row, bits),
        DecodingResult::U8(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::U16(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::U32(values) => values.into_iter().map(|x| x as f32).collect(),
        DecodingResult::U64(values) => values.into_iter().map(|x| x as f32).collect(),
        DecodingResult::I8(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::I16(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::I32(values) => values.into_iter().map(|x| x as f32).collect(),
        DecodingResult::I64(values) => values.into_iter().map(|x| x as f32).collect(),
        DecodingResult::F16(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::F32(values) => values,
        DecodingResult::F64(values) => values.into_iter().map(narrow).collect(),
    };
    let integer_bits = (!float).then_some(u32::from(color.bit_depth()));
    Ok(Raster {
        channels,
        has_alpha,
        // The colors of a palette are not read.
        background: matches!(color, ColorType::Palette(_)).then(Vec::new),
        ..Raster::gray(size, integer_bits, samples)
    })
}
