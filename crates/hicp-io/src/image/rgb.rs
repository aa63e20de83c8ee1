//! Color images in PNG files, for pictures of results. No computation uses them.

use std::path::Path;

use png::{BitDepth, ColorType, Transformations};

use super::pixels;
use crate::error::IoError;
use crate::limits::ReadLimits;

/// Reads a PNG file of any pixel type as 8-bit RGB.
///
/// Returns the width, the height, and 3 · width · height bytes, row-major. Gray values are
/// repeated, 16-bit samples lose their low byte, and transparency is dropped.
///
/// # Errors
///
/// As for [`read_depth_png`](crate::read_depth_png), except for the errors about scale and pixel
/// type.
pub fn read_rgb_png(path: impl AsRef<Path>) -> Result<(u32, u32, Vec<u8>), IoError> {
    let transformations = Transformations::EXPAND | Transformations::STRIP_16;
    let image = pixels::read(&ReadLimits::DEFAULT, path.as_ref(), transformations, false)?;
    let pixels = image.bytes.chunks_exact(image.color.samples());
    let bytes = match image.color {
        ColorType::Rgb | ColorType::Rgba => pixels.flat_map(|p| [p[0], p[1], p[2]]).collect(),
        _ => pixels.flat_map(|pixel| [pixel[0]; 3]).collect(),
    };
    Ok((image.width, image.height, bytes))
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
        let (found, expected) = (
            format!("{} bytes of pixels", rgb.len()),
            expected.to_string(),
        );
        return Err(IoError::new(path, None, found, expected));
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
        assert_eq!(read_rgb_png(&path).unwrap(), (4, 3, rgb.clone()));
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
            (
                (ColorType::Grayscale, BitDepth::Sixteen),
                vec![7, 9],
                [7; 3],
            ),
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
            assert_eq!(read_rgb_png(&path).unwrap().2, expected, "{kind:?}");
        }
    }
}
