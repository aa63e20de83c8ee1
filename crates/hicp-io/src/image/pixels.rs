//! Raw pixels of PNG files, read within limits.

use std::io::{self, Cursor};
use std::path::Path;

use png::{BitDepth, ColorType, DecodingError, Transformations};

use super::raster::{Raster, check_size, unpack};
use crate::atomic::write_atomically;
use crate::error::IoError;
use crate::limits::ReadLimits;
use crate::source::read_head;

/// The pixels of an image as the decoder returns them.
///
/// Rows have no padding. Samples of 16 bits are big-endian.
pub(super) struct Pixels {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) color: ColorType,
    pub(super) depth: BitDepth,
    /// For a palette: whether a color is black or transparent.
    background: Option<Vec<bool>>,
    pub(super) bytes: Vec<u8>,
}

impl From<Pixels> for Raster {
    fn from(image: Pixels) -> Self {
        let channels = image.color.samples();
        let samples = match image.depth {
            BitDepth::Sixteen => {
                let pairs = image.bytes.chunks_exact(2);
                pairs
                    .map(|b| u16::from_be_bytes([b[0], b[1]]).into())
                    .collect()
            }
            depth => unpack(
                &image.bytes,
                image.width as usize * channels,
                depth as usize,
            ),
        };
        Self {
            channels,
            has_alpha: matches!(image.color, ColorType::GrayscaleAlpha | ColorType::Rgba),
            background: image.background,
            ..Self::gray(
                (image.width, image.height),
                Some(image.depth as u32),
                samples,
            )
        }
    }
}

/// Reads a PNG file as [`decode`] does.
pub(super) fn read(
    limits: &ReadLimits,
    path: &Path,
    transformations: Transformations,
) -> Result<Pixels, IoError> {
    let content = limits.read_bytes(path)?;
    decode(limits, path, &content, transformations)
}

/// Decodes a PNG file.
pub(super) fn decode(
    limits: &ReadLimits,
    path: &Path,
    content: &[u8],
    transformations: Transformations,
) -> Result<Pixels, IoError> {
    let available = content.len() as u64;
    // The decoder's own limit covers only its working memory. The limit of this crate, below,
    // covers the image.
    let mut decoder = png::Decoder::new(Cursor::new(content));
    decoder.set_transformations(transformations);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let failed = |error| failed(path, error);

    let header = decoder.read_header_info().map_err(failed)?;
    let (width, height) = header.size();
    let indexed = header.color_type == ColorType::Indexed;
    let (size, raw) = ((width.into(), height.into()), header.raw_bytes() as u64);
    check_size(limits, (path, 16), size, raw, available)?;

    let mut reader = decoder.read_info().map_err(failed)?;
    // The decoder does not check the palette. It panics if the palette is cut short or has more
    // opacities than colors.
    if let Some(palette) = &reader.info().palette {
        let opacities = reader.info().trns.as_ref().map_or(0, |trns| trns.len());
        if palette.len() % 3 != 0 || (indexed && opacities > palette.len() / 3) {
            let bytes = palette.len();
            let found = format!("a palette of {bytes} bytes of colors and {opacities} opacities");
            let expected = "three bytes per color, and at most one opacity for each";
            return Err(IoError::new(path, None, found, expected));
        }
    }
    let background = reader
        .info()
        .palette
        .as_ref()
        .filter(|_| indexed)
        .map(|palette| {
            let opacities = reader.info().trns.as_deref().unwrap_or_default();
            let transparent = |index: usize| opacities.get(index) == Some(&0);
            let colors = palette.chunks_exact(3).enumerate();
            colors
                .map(|(index, color)| *color == [0; 3] || transparent(index))
                .collect()
        });
    let size = reader.output_buffer_size();
    let size = size.ok_or(DecodingError::LimitsExceeded).map_err(failed)?;
    let mut bytes = Vec::new();
    let reserved = bytes.try_reserve_exact(size);
    reserved.map_err(|_| IoError::read(path, io::ErrorKind::OutOfMemory.into()))?;
    bytes.resize(size, 0);
    let frame = reader.next_frame(&mut bytes).map_err(failed)?;
    bytes.truncate(frame.buffer_size());
    let (color, depth) = (frame.color_type, frame.bit_depth);
    Ok(Pixels {
        width,
        height,
        color,
        depth,
        background,
        bytes,
    })
}

/// Reads the width and height of a PNG image, in pixels, from its header only.
///
/// # Errors
///
/// [`IoError`] if the file cannot be read or does not start as a PNG image.
pub fn read_png_size(path: impl AsRef<Path>) -> Result<(u32, u32), IoError> {
    let path = path.as_ref();
    let (head, _) = read_head(path)?;
    let mut decoder = png::Decoder::new(Cursor::new(head));
    let header = decoder
        .read_header_info()
        .map_err(|error| failed(path, error))?;
    Ok(header.size())
}

/// Writes pixels of one kind to a PNG file, atomically. Samples of 16 bits are big-endian.
pub(super) fn write(
    path: &Path,
    (width, height): (u32, u32),
    (color, depth): (ColorType, BitDepth),
    bytes: &[u8],
) -> Result<(), IoError> {
    write_atomically(path, |writer| {
        let mut encoder = png::Encoder::new(writer, width, height);
        encoder.set_color(color);
        encoder.set_depth(depth);
        let mut image = encoder.write_header().map_err(io::Error::other)?;
        image.write_image_data(bytes).map_err(io::Error::other)?;
        image.finish().map_err(io::Error::other)
    })
}

fn failed(path: &Path, error: DecodingError) -> IoError {
    let found = "data that are not a complete PNG image";
    IoError::new(path, None, found, "a PNG image").with_source(error)
}
