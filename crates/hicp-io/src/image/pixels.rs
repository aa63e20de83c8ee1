//! Raw pixels from and to PNG files, within limits.

use std::io::{self, Cursor};
use std::path::Path;

use hicp_core::MAX_IMAGE_SIDE;
use png::{BitDepth, ColorType, DecodingError, Transformations};

use crate::atomic::write_atomically;
use crate::error::{IoError, Place};
use crate::limits::ReadLimits;
use crate::source::{Source, read_bytes};

/// Largest number of pixels of an image that is read unless told otherwise: 2²⁵, four times those of a 4K camera.
pub const MAX_IMAGE_PIXELS: u64 = ReadLimits::DEFAULT.max_pixels;

/// Deflate packs at most 1032 bytes into one: a smaller file cannot hold the image it announces.
const MAX_COMPRESSION: u64 = 1032;

/// The pixels of an image as the decoder hands them out: rows without padding, samples of 16 bits big-endian.
pub(super) struct Pixels {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) color: ColorType,
    pub(super) depth: BitDepth,
    pub(super) bytes: Vec<u8>,
}

/// Decodes a PNG file.
///
/// `accept` sees the pixel type of the header, before anything is allocated; it says what it expects when it refuses.
pub(super) fn read(
    limits: &ReadLimits,
    path: &Path,
    transformations: Transformations,
    accept: impl FnOnce(ColorType, BitDepth) -> Result<(), &'static str>,
) -> Result<Pixels, IoError> {
    let content = read_bytes(path, limits.max_file_bytes)?;
    let available = content.len() as u64;
    // Its own limit is on what it holds beside the image; this crate's, below, on the image.
    let mut decoder = png::Decoder::new(Cursor::new(content));
    decoder.set_transformations(transformations);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let failed = |error| failed(path, error);

    let header = decoder.read_header_info().map_err(failed)?;
    let (width, height) = header.size();
    let indexed = header.color_type == ColorType::Indexed;
    accept(header.color_type, header.bit_depth).map_err(|expected| IoError::PixelType {
        path: path.to_owned(),
        found: describe(header.color_type, header.bit_depth),
        expected,
    })?;
    let count = u64::from(width) * u64::from(height);
    if width.max(height) > MAX_IMAGE_SIDE || count > limits.max_pixels {
        return Err(IoError::ImageTooLarge {
            path: path.to_owned(),
            width,
            height,
            max_side: MAX_IMAGE_SIDE,
            max_pixels: limits.max_pixels,
        });
    }
    let needed = (header.raw_bytes() as u64) / MAX_COMPRESSION;
    if needed > available {
        return Err(IoError::Promise {
            path: path.to_owned(),
            place: Place::Byte(16),
            what: "pixels".to_owned(),
            count,
            needed,
            available,
        });
    }

    let mut reader = decoder.read_info().map_err(failed)?;
    // The decoder takes a palette on trust, and panics over one that is cut short or has more opacities than colours.
    if let Some(palette) = &reader.info().palette {
        let opacities = reader.info().trns.as_ref().map_or(0, |trns| trns.len());
        if palette.len() % 3 != 0 || (indexed && opacities > palette.len() / 3) {
            return Err(IoError::PixelType {
                path: path.to_owned(),
                found: format!(
                    "palette ({} bytes of colours, {opacities} opacities)",
                    palette.len()
                ),
                expected: "three bytes per colour, and at most one opacity for each",
            });
        }
    }
    let size = reader
        .output_buffer_size()
        .ok_or(DecodingError::LimitsExceeded)
        .map_err(failed)?;
    let mut bytes = Vec::new();
    let reserved = bytes.try_reserve_exact(size);
    reserved.map_err(|_| IoError::read(path, io::ErrorKind::OutOfMemory.into()))?;
    bytes.resize(size, 0);
    let frame = reader.next_frame(&mut bytes).map_err(failed)?;
    bytes.truncate(frame.buffer_size());
    Ok(Pixels {
        width,
        height,
        color: frame.color_type,
        depth: frame.bit_depth,
        bytes,
    })
}

/// Reads the width and height of a PNG image from its header, and no more of the file.
///
/// # Errors
///
/// [`IoError::Read`], or [`IoError::Png`] when the file does not begin as a PNG image.
pub fn read_png_size(path: impl AsRef<Path>) -> Result<(u32, u32), IoError> {
    let path = path.as_ref();
    let mut decoder = png::Decoder::new(Cursor::new(Source::open(path)?.head()?));
    match decoder.read_header_info() {
        Ok(header) => Ok(header.size()),
        Err(error) => Err(failed(path, error)),
    }
}

/// Encodes pixels of one kind as a PNG file, atomically. Samples of 16 bits are big-endian.
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
    match error {
        DecodingError::IoError(source) if source.kind() != io::ErrorKind::UnexpectedEof => {
            IoError::read(path, source)
        }
        other => IoError::Png {
            path: path.to_owned(),
            source: other.into(),
        },
    }
}

fn describe(color: ColorType, depth: BitDepth) -> String {
    let color = match color {
        ColorType::Grayscale => "gray",
        ColorType::Rgb => "RGB",
        ColorType::Indexed => "palette",
        ColorType::GrayscaleAlpha => "gray + alpha",
        ColorType::Rgba => "RGBA",
    };
    format!("{}-bit {color}", depth as u8)
}
