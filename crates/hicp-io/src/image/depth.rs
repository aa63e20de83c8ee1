//! Depth images: 16-bit PNG files, and files of other formats.

use std::path::{Path, PathBuf};

use hicp_core::DepthImage;
use png::{BitDepth, ColorType, Transformations};

use super::decode;
use super::pixels;
use super::raster::Raster;
use crate::error::IoError;
use crate::limits::ReadLimits;
use crate::number::{narrow, whole};

/// Reads a depth image from a 16-bit gray PNG file; 0 and 65535 mean missing.
///
/// `millimeters_per_unit` is the depth of one unit, which BOP calls `depth_scale`. Depths above
/// `hicp_core::MAX_DEPTH_METERS` become missing.
///
/// # Errors
///
/// [`IoError`] in these cases:
///
/// - The scale is not finite and positive.
/// - The file cannot be read or decoded.
/// - The pixels are not 16-bit gray.
/// - A side is above `hicp_core::MAX_IMAGE_SIDE`, or there are more pixels than
///   [`ReadLimits::DEFAULT`] allows. Both are checked before allocating.
/// - The file is too small to hold the image that its header announces.
pub fn read_depth_png(
    path: impl AsRef<Path>,
    millimeters_per_unit: f64,
) -> Result<DepthImage, IoError> {
    ReadLimits::DEFAULT.read_depth_png(path, millimeters_per_unit)
}

impl ReadLimits {
    /// Reads a file as [`read_depth_png`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_depth_png`].
    pub fn read_depth_png(
        &self,
        path: impl AsRef<Path>,
        millimeters_per_unit: f64,
    ) -> Result<DepthImage, IoError> {
        let path = path.as_ref();
        check_scale(path, millimeters_per_unit)?;
        let image = pixels::read(self, path, Transformations::IDENTITY)?;
        if (image.color, image.depth) != (ColorType::Grayscale, BitDepth::Sixteen) {
            return Err(other_pixels(path, &image.into(), "16-bit gray pixels"));
        }
        // Without samples in between, reading takes a sixth less time.
        let to_meters = |bytes: &[u8]| match u16::from_be_bytes([bytes[0], bytes[1]]) {
            DepthImage::SATURATED => 0.0,
            units => narrow(f64::from(units) * millimeters_per_unit / 1000.0),
        };
        let meters = image.bytes.chunks_exact(2).map(to_meters).collect();
        let depth = DepthImage::from_meters(image.width, image.height, meters);
        depth.map_err(|error| IoError::unusable(path, "depth image", error))
    }
}

/// The supported formats.
const FORMATS: &str = "PNG, TIFF, NPY, NPZ, EXR, PGM or PFM";

/// Reads a depth image of any supported format, recognized by its first bytes.
///
/// - PNG and PGM: 16-bit gray.
/// - TIFF, NPY and NPZ: integers of 16 to 64 bits, or floating point.
/// - EXR: integers of 32 bits, or floating point.
/// - PFM: floating point.
///
/// 0, NaN, infinity and negative numbers mean missing. In 16-bit integers, 65535 does, too.
///
/// `millimeters_per_unit` is the depth of one unit. `None` means that the numbers are meters, which
/// requires floating point. Of an EXR file, the channel `Z` or `depth` is read, also that of a
/// layer, or the only channel. Of an NPZ archive, the only array is read, or else `depth`, `image`,
/// `data` or `arr_0`.
///
/// # Errors
///
/// As for [`read_depth_png`], except for its pixel type. Also in these cases:
///
/// - The pixels are colors, or integers of fewer than 16 bits.
/// - The numbers are integers, and `millimeters_per_unit` is `None`.
/// - The format needs a cargo feature that is off.
pub fn read_depth(
    path: impl AsRef<Path>,
    millimeters_per_unit: Option<f64>,
) -> Result<DepthImage, IoError> {
    ReadLimits::DEFAULT
        .read_raw_depth(path)?
        .scaled(millimeters_per_unit)
}

/// A depth image in the unit of its file.
///
/// It serves callers that need its size or the type of its numbers before they can state the unit.
#[derive(Debug)]
pub struct RawDepth {
    path: PathBuf,
    raster: Raster,
}

impl RawDepth {
    /// Returns the width and height, pixels.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.raster.width, self.raster.height)
    }

    /// Returns whether the numbers are floating point, and so probably meters.
    #[must_use]
    pub fn is_float(&self) -> bool {
        self.raster.integer_bits.is_none()
    }

    /// Converts to meters, as [`read_depth`] does.
    ///
    /// # Errors
    ///
    /// [`IoError`] if the unit is not finite and positive, or is missing for integers.
    pub fn scaled(self, millimeters_per_unit: Option<f64>) -> Result<DepthImage, IoError> {
        let (path, (width, height)) = (&self.path, self.size());
        let millimeters = match millimeters_per_unit {
            Some(millimeters) => millimeters,
            None if self.is_float() => 1000.0,
            None => {
                let expected = "floating-point meters, or the millimeters per unit (--depth-scale)";
                return Err(IoError::new(path, None, "integers", expected));
            }
        };
        check_scale(path, millimeters)?;
        let is_16_bit = self.raster.integer_bits == Some(16);
        let meters = |units: f32| match is_16_bit && units == f32::from(DepthImage::SATURATED) {
            true => 0.0,
            false => narrow(f64::from(units) * millimeters / 1000.0),
        };
        let depth = DepthImage::collect(width, height, self.raster.samples.into_iter().map(meters));
        depth.map_err(|error| IoError::unusable(path, "depth image", error))
    }
}

impl ReadLimits {
    /// Reads a depth image of any format, as [`read_depth`] does, but in the unit of its file.
    ///
    /// # Errors
    ///
    /// As for [`read_depth`].
    pub fn read_raw_depth(&self, path: impl AsRef<Path>) -> Result<RawDepth, IoError> {
        let path = path.as_ref();
        let raster = decode::read(self, path, "depth", FORMATS)?;
        let is_gray = raster.channels == 1 && raster.background.is_none();
        if is_gray && raster.integer_bits.is_none_or(|bits| bits >= 16) {
            let path = path.to_owned();
            return Ok(RawDepth { path, raster });
        }
        let expected = "16-bit gray pixels, or one floating-point number per pixel";
        Err(other_pixels(path, &raster, expected))
    }
}

/// Returns the error for an image whose pixels are not those of a depth image.
fn other_pixels(path: &Path, image: &Raster, expected: &str) -> IoError {
    let kind = match image.channels {
        1 if image.background.is_some() => "palette",
        1 => "gray",
        2 => "gray + alpha",
        3 => "RGB",
        _ => "RGBA",
    };
    let found = match image.integer_bits {
        Some(bits) => format!("{bits}-bit {kind} pixels"),
        None => format!("floating-point {kind} pixels"),
    };
    IoError::new(path, None, found, expected)
}

/// Writes a depth image as a 16-bit gray PNG file; missing depths become 0.
///
/// `millimeters_per_unit` is the depth of one unit. Depths are rounded to the nearest unit; a depth
/// below half a unit becomes missing.
///
/// # Errors
///
/// [`IoError`] if the scale is not finite and positive, or if a depth is above 65534 units,
/// since 65535 means missing.
/// Otherwise as for [`write_atomically`](crate::write_atomically).
pub fn write_depth_png(
    path: impl AsRef<Path>,
    depth: &DepthImage,
    millimeters_per_unit: f64,
) -> Result<(), IoError> {
    let path = path.as_ref();
    let size = (depth.width(), depth.height());
    let kind = (ColorType::Grayscale, BitDepth::Sixteen);
    pixels::write(
        path,
        size,
        kind,
        &in_units(path, depth, millimeters_per_unit)?,
    )
}

/// Returns the big-endian bytes of an image in the unit of its file.
fn in_units(
    path: &Path,
    depth: &DepthImage,
    millimeters_per_unit: f64,
) -> Result<Vec<u8>, IoError> {
    check_scale(path, millimeters_per_unit)?;
    let most = f64::from(DepthImage::SATURATED - 1);
    let mut bytes = Vec::with_capacity(2 * depth.pixels().len());
    for (index, &meters) in depth.pixels().iter().enumerate() {
        let units = (f64::from(meters) * 1000.0 / millimeters_per_unit).round();
        if !(0.0..=most).contains(&units) {
            let width = depth.width() as usize;
            let found = format!(
                "a depth of {meters} m at pixel ({}, {})",
                index % width,
                index / width
            );
            let limit = most * millimeters_per_unit / 1000.0;
            let expected = format!("at most {limit} m at this scale");
            return Err(IoError::new(path, None, found, expected));
        }
        let [.., high, low] = whole(units).to_be_bytes();
        bytes.extend([high, low]);
    }
    Ok(bytes)
}

fn check_scale(path: &Path, value: f64) -> Result<(), IoError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    let found = format!("a depth scale of {value} mm per unit");
    Err(IoError::new(path, None, found, "a finite number above 0"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn depths_survive_writing_and_reading(
            units in prop::collection::vec(prop_oneof![9 => any::<u16>(), 1 => Just(u16::MAX)], 12),
            scale in prop::sample::select(vec![0.1, 1.0, 0.125, 0.05, 10.0]),
        ) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("depth.png");
            let bytes: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
            pixels::write(&path, (4, 3), (ColorType::Grayscale, BitDepth::Sixteen), &bytes).unwrap();
            let depth = read_depth_png(&path, scale).unwrap();
            write_depth_png(&path, &depth, scale).unwrap();
            let again = read_depth_png(&path, scale).unwrap();
            prop_assert_eq!(&read_depth(&path, Some(scale)).unwrap(), &depth);
            prop_assert_eq!(pixels::read_png_size(&path).unwrap(), (4, 3));
            prop_assert_eq!(&again, &depth);
            for (meters, unit) in depth.pixels().iter().zip(&units) {
                let unit = if *unit == u16::MAX { &0 } else { unit };
                prop_assert!((f64::from(*meters) * 1000.0 - f64::from(*unit) * scale).abs() < 0.05);
            }
        }
    }

    #[test]
    fn scales_and_ranges_are_checked() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let depth = DepthImage::from_meters(2, 1, vec![0.0, 70.0]).unwrap();
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                write_depth_png(&path, &depth, scale),
                Err(IoError { found, .. }) if found.starts_with("a depth scale of")
            ));
            assert!(matches!(
                read_depth_png(&path, scale),
                Err(IoError { found, .. }) if found.starts_with("a depth scale of")
            ));
        }
        assert!(matches!(
            write_depth_png(&path, &depth, 1.0),
            Err(IoError { found, .. }) if found == "a depth of 70 m at pixel (1, 0)"
        ));
        assert!(!path.exists());
        write_depth_png(&path, &depth, 10.0).unwrap();
        assert_eq!(read_depth_png(&path, 10.0).unwrap(), depth);
        let saturated = DepthImage::from_meters(1, 1, vec![65.535]).unwrap();
        let error = write_depth_png(&path, &saturated, 1.0).unwrap_err();
        assert_eq!(error.expected, "at most 65.534 m at this scale");
    }
}
