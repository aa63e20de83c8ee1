//! Masks in PNG files.

use std::path::Path;

use hicp_core::Mask;
use png::{BitDepth, ColorType, Transformations};

use super::pixels;
use crate::error::IoError;
use crate::limits::ReadLimits;

/// Reads a mask from a PNG file of any pixel type.
///
/// A pixel belongs to the object if a gray or color sample is not 0. In palette images, the color
/// counts and not the index, so black is background. Transparency is ignored.
///
/// # Errors
///
/// As for [`read_depth_png`](crate::read_depth_png), except for the errors about scale and pixel
/// type.
pub fn read_mask_png(path: impl AsRef<Path>) -> Result<Mask, IoError> {
    ReadLimits::DEFAULT.read_mask_png(path)
}

impl ReadLimits {
    /// Reads a file as [`read_mask_png`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_mask_png`].
    pub fn read_mask_png(&self, path: impl AsRef<Path>) -> Result<Mask, IoError> {
        let path = path.as_ref();
        let image = pixels::read(self, path, Transformations::EXPAND)?;
        let sample_bytes = 1 + usize::from(image.depth == BitDepth::Sixteen);
        let samples = image.color.samples();
        let has_alpha = matches!(image.color, ColorType::GrayscaleAlpha | ColorType::Rgba);
        let opaque = (samples - usize::from(has_alpha)) * sample_bytes;
        let mask = match samples * sample_bytes {
            // The loop over pixels of any size takes twenty instructions for each.
            1 => image.bytes.iter().map(|byte| *byte != 0).collect(),
            size => {
                let pixels = image.bytes.chunks_exact(size);
                let set = |pixel: &[u8]| pixel[..opaque].iter().any(|byte| *byte != 0);
                pixels.map(set).collect()
            }
        };
        let mask = Mask::new(image.width, image.height, mask);
        mask.map_err(|error| IoError::unusable(path, "mask", error))
    }
}

/// Writes a mask as a PNG file of 8-bit gray values: 255 for the object, 0 elsewhere.
///
/// # Errors
///
/// As for [`write_atomically`](crate::write_atomically).
pub fn write_mask_png(path: impl AsRef<Path>, mask: &Mask) -> Result<(), IoError> {
    let kind = (ColorType::Grayscale, BitDepth::Eight);
    pixels::write(path.as_ref(), mask.size(), kind, &bytes_of(mask))
}

fn bytes_of(mask: &Mask) -> Vec<u8> {
    mask.pixels()
        .iter()
        .map(|set| u8::from(*set) * 255)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_survive_writing_and_reading() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mask.png");
        let mask = Mask::new(5, 3, (0..15).map(|i| i % 4 == 1).collect()).unwrap();
        write_mask_png(&path, &mask).unwrap();
        assert_eq!(read_mask_png(&path).unwrap(), mask);
    }

    #[test]
    fn every_pixel_type_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mask.png");
        // Each case has two pixels: background (opaque if there is alpha), then object.
        let cases: [((ColorType, BitDepth), &[u8]); 7] = [
            ((ColorType::Grayscale, BitDepth::One), &[0b0100_0000]),
            ((ColorType::Grayscale, BitDepth::Four), &[0x01]),
            ((ColorType::Grayscale, BitDepth::Sixteen), &[0, 0, 0, 1]),
            (
                (ColorType::GrayscaleAlpha, BitDepth::Eight),
                &[0, 255, 1, 0],
            ),
            ((ColorType::Rgb, BitDepth::Eight), &[0, 0, 0, 0, 0, 9]),
            (
                (ColorType::Rgba, BitDepth::Eight),
                &[0, 0, 0, 255, 0, 1, 0, 0],
            ),
            (
                (ColorType::Rgb, BitDepth::Sixteen),
                &[0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0],
            ),
        ];
        for (kind, bytes) in cases {
            pixels::write(&path, (2, 1), kind, bytes).unwrap();
            assert_eq!(
                read_mask_png(&path).unwrap().pixels(),
                [false, true],
                "{kind:?}"
            );
        }
    }

    #[test]
    fn palette_pixels_are_classified_by_color() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mask.png");
        let file = std::fs::File::create(&path).unwrap();
        let mut encoder = png::Encoder::new(file, 2, 1);
        encoder.set_color(ColorType::Indexed);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_palette(vec![0, 200, 0, 0, 0, 0]);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&[0, 1]).unwrap();
        writer.finish().unwrap();
        assert_eq!(read_mask_png(&path).unwrap().pixels(), [true, false]);
    }
}
