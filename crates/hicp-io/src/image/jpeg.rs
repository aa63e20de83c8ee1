//! JPEG images.

use std::path::Path;

use hicp_core::{ColorImage, MAX_IMAGE_SIDE};
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::raster::check_size;
use crate::error::IoError;
use crate::limits::ReadLimits;

/// Decodes a JPEG image, baseline or progressive.
pub(super) fn decode(
    limits: &ReadLimits,
    path: &Path,
    content: &[u8],
) -> Result<ColorImage, IoError> {
    let failed = |error: DecodeErrors| {
        let found = "data that are not a complete JPEG image";
        IoError::new(path, None, found, "a JPEG image").with_source(error)
    };
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(MAX_IMAGE_SIDE as usize)
        .set_max_height(MAX_IMAGE_SIDE as usize)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(content), options);
    decoder.decode_headers().map_err(failed)?;
    let (width, height) = decoder.dimensions().unwrap_or_default();
    let size = (width as u64, height as u64);
    let raw = size.0.saturating_mul(size.1).saturating_mul(3);
    let (width, height) = check_size(limits, (path, 0), size, raw, content.len() as u64)?;
    let bytes = decoder.decode().map_err(failed)?;
    let image = ColorImage::from_rgb(width, height, &bytes);
    image.map_err(|error| IoError::unusable(path, "color image", error))
}
