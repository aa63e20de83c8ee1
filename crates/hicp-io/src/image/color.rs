//! Color images: PNG, JPEG and TIFF files.

use std::path::Path;

use hicp_core::ColorImage;
use png::{BitDepth, ColorType, Transformations};

use super::pixels;
use crate::error::IoError;
use crate::format::{self, Format};
use crate::limits::ReadLimits;
#[cfg(feature = "tiff")]
use crate::number::byte;

/// Reads a color image from a PNG, JPEG or TIFF file.
///
/// The first bytes select the format. Gray values are repeated for the three channels, 16-bit
/// samples are reduced to 8 bits, and transparency is dropped. JPEG needs the feature `jpeg`, and
/// TIFF the feature `tiff`.
///
/// # Errors
///
/// As for [`read_depth_png`](crate::read_depth_png), except for the errors about scale and pixel
/// type. Also in these cases:
///
/// - The file has another format.
/// - The pixels are 16-bit gray, as in depth images.
/// - The file is a TIFF image with floating-point or palette colors.
pub fn read_color(path: impl AsRef<Path>) -> Result<ColorImage, IoError> {
    ReadLimits::DEFAULT.read_color(path)
}

impl ReadLimits {
    /// Reads a file as [`read_color`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_color`].
    pub fn read_color(&self, path: impl AsRef<Path>) -> Result<ColorImage, IoError> {
        let path = path.as_ref();
        decode(self, path, &self.read_bytes(path)?)
    }
}

/// Decodes the content of a color image. `path` is its file, or the file that contains it.
pub(crate) fn decode(
    limits: &ReadLimits,
    path: &Path,
    content: &[u8],
) -> Result<ColorImage, IoError> {
    match Format::of(content) {
        Some(Format::Png) => decode_png(limits, path, content),
        #[cfg(feature = "jpeg")]
        Some(Format::Jpeg) => super::jpeg::decode(limits, path, content),
        #[cfg(not(feature = "jpeg"))]
        Some(Format::Jpeg) => Err(format::without_feature(path, Format::Jpeg, "jpeg")),
        #[cfg(feature = "tiff")]
        Some(Format::Tiff) => of_raster(path, &super::tiff::decode(limits, path, content)?),
        #[cfg(not(feature = "tiff"))]
        Some(Format::Tiff) => Err(format::without_feature(path, Format::Tiff, "tiff")),
        _ => {
            let expected = "a color image as PNG, JPEG or TIFF";
            Err(format::refuse(path, content, expected))
        }
    }
}

#[cfg(feature = "tiff")]
fn of_raster(path: &Path, image: &super::raster::Raster) -> Result<ColorImage, IoError> {
    let bits = image.integer_bits.filter(|_| image.background.is_none());
    if image.channels == 1 && bits == Some(16) {
        return Err(depth_pixels(path));
    }
    let Some(bits) = bits else {
        let expected = "integers of gray, RGB or RGBA";
        return Err(IoError::new(
            path,
            None,
            "floating-point or palette colors",
            expected,
        ));
    };
    let scale = 255.0 / (2.0_f64.powi(bits.cast_signed()) - 1.0);
    let channel = |sample: f32| byte(scale * f64::from(sample));
    let colors = image.channels - usize::from(image.has_alpha);
    let pixels = image.samples.chunks_exact(image.channels);
    let pixels = pixels.map(|p| [p[0], p[colors / 2], p[colors - 1]].map(channel));
    let image = ColorImage::new(image.width, image.height, pixels.collect());
    image.map_err(|error| IoError::unusable(path, "color image", error))
}

/// Returns the error for a file whose pixels are those of a depth image.
fn depth_pixels(path: &Path) -> IoError {
    let expected = "a color image: depth images have such pixels";
    IoError::new(path, None, "16-bit gray pixels", expected)
}

fn decode_png(limits: &ReadLimits, path: &Path, content: &[u8]) -> Result<ColorImage, IoError> {
    let transformations = Transformations::EXPAND | Transformations::STRIP_16;
    let image = pixels::decode(limits, path, content, transformations)?;
    // The bit depth and the color type of the header; the decoder has removed the low bytes.
    if let Some([16, 0]) = content.get(24..26) {
        return Err(depth_pixels(path));
    }
    let pixels = image.bytes.chunks_exact(image.color.samples());
    let pixels = match image.color {
        ColorType::Rgb | ColorType::Rgba => pixels.map(|p| [p[0], p[1], p[2]]).collect(),
        _ => pixels.map(|pixel| [pixel[0]; 3]).collect(),
    };
    let image = ColorImage::new(image.width, image.height, pixels);
    image.map_err(|error| IoError::unusable(path, "color image", error))
}

/// Writes 8-bit RGB pixels (3 · `width` · `height` bytes, row-major) as a PNG file.
///
/// # Errors
///
/// [`IoError`] if the number of bytes does not match the size, otherwise as for
/// [`write_atomically`](crate::write_atomically).
pub fn write_rgb_png(
    path: impl AsRef<Path>,
    width: u32,
    height: u32,
    rgb: &[u8],
) -> Result<(), IoError> {
    let path = path.as_ref();
    let expected = 3 * u128::from(width) * u128::from(height);
    if rgb.len() as u128 != expected {
        let found = format!("{} bytes of pixels", rgb.len());
        return Err(IoError::new(path, None, found, expected.to_string()));
    }
    let kind = (ColorType::Rgb, BitDepth::Eight);
    pixels::write(path, (width, height), kind, rgb)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_survive_writing_and_reading_and_sizes_are_checked() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let rgb: Vec<u8> = (0..36).collect();
        write_rgb_png(&path, 4, 3, &rgb).unwrap();
        let expected = ColorImage::from_rgb(4, 3, &rgb).unwrap();
        assert_eq!(read_color(&path).unwrap(), expected);
        assert!(matches!(
            write_rgb_png(&path, 4, 4, &rgb),
            Err(IoError { found, expected, .. })
            if found == "36 bytes of pixels" && expected == "48"
        ));
    }

    #[test]
    fn other_pixel_types_become_rgb() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        for (kind, bytes, expected) in [
            ((ColorType::Grayscale, BitDepth::One), vec![0x80], [255; 3]),
            ((ColorType::Rgb, BitDepth::Sixteen), vec![7; 6], [7; 3]),
            (
                (ColorType::GrayscaleAlpha, BitDepth::Eight),
                vec![7, 9],
                [7; 3],
            ),
            (
                (ColorType::Rgba, BitDepth::Eight),
                vec![1, 2, 3, 4],
                [1, 2, 3],
            ),
        ] {
            pixels::write(&path, (1, 1), kind, &bytes).unwrap();
            assert_eq!(read_color(&path).unwrap().pixels(), [expected], "{kind:?}");
        }
    }
}
