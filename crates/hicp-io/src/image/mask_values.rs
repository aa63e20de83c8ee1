//! Masks of any format, from the values of their pixels.

use std::path::Path;

use hicp_core::Mask;

use super::decode;
use super::raster::Raster;
use crate::error::IoError;
use crate::limits::ReadLimits;
use crate::number::{narrow, whole};

/// The supported formats.
const FORMATS: &str = "PNG, TIFF, BMP, NPY, NPZ or PGM";

/// The pixels of a mask that belong to the object.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum MaskRule {
    /// Every value but 0. In a PNG or BMP palette, every color but black and transparent ones.
    #[default]
    NotZero,
    /// Every value of at least this number, for probabilities and soft masks.
    AtLeast(f64),
    /// The value, for label images.
    Equal(f64),
}

impl MaskRule {
    /// Start of the values of colored pixels.
    ///
    /// The value of a color is this plus 65536 · red + 256 · green + blue, each from 0 to 255.
    pub const COLOR: f64 = 16_777_216.0;
}

/// A mask, and a warning about its values.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskFile {
    /// The mask.
    pub mask: Mask,
    /// A message with the values and the options that choose among them, for
    /// [`MaskRule::NotZero`].
    ///
    /// `None` if the file has a single value, or two values of which one is the background.
    pub warning: Option<String>,
    /// With a warning: the distinct values without the background, ascending, at most 256.
    /// Otherwise empty.
    pub values: Vec<f64>,
    /// With a warning: the least value on the object if the mask is soft. Otherwise 0.
    ///
    /// It is 0 if some values are negative, 1 if there are colors, and otherwise half of the
    /// largest value, rounded.
    pub threshold: f64,
}

/// Reads a mask of any supported format, recognized by its first bytes.
///
/// `rule` selects the pixels of the object by their value:
///
/// - The value of a pixel is its gray value, or in a palette image its index.
/// - Colors that are not gray have values from [`MaskRule::COLOR`] on.
/// - If the opacity varies within the image, the opacity is the value.
///
/// Of an NPZ archive, the only array is read, or else `mask`, `image`, `data` or `arr_0`.
///
/// # Errors
///
/// [`IoError`] if the file is not an image of such a format, is above a limit or damaged, or if
/// `rule` selects no pixel (never for [`MaskRule::NotZero`]).
pub fn read_mask(path: impl AsRef<Path>, rule: MaskRule) -> Result<MaskFile, IoError> {
    ReadLimits::DEFAULT.read_mask(path, rule)
}

impl ReadLimits {
    /// Reads a mask as [`read_mask`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_mask`].
    pub fn read_mask(&self, path: impl AsRef<Path>, rule: MaskRule) -> Result<MaskFile, IoError> {
        let path = path.as_ref();
        MaskFile::of(path, &decode::read(self, path, "mask", FORMATS)?, rule)
    }
}

impl MaskFile {
    /// Returns the mask of an image from a file.
    fn of(path: &Path, image: &Raster, rule: MaskRule) -> Result<Self, IoError> {
        let values = values(image);
        let background = image.background.as_deref().unwrap_or_default();
        let is_background = |value: f64| {
            background
                .get(whole(value) as usize)
                .copied()
                .unwrap_or(value == 0.0)
        };
        let selected = |value: f64| match rule {
            MaskRule::NotZero => !is_background(value),
            MaskRule::AtLeast(least) => value >= least,
            MaskRule::Equal(number) => value == number,
        };
        let pixels: Vec<bool> = values.clone().map(selected).collect();
        let (mut warning, mut distinct, mut threshold) = (None, Vec::new(), 0.0);
        if rule == MaskRule::NotZero {
            let found = Values::of(values);
            let no_background = !found.distinct.iter().any(|value| is_background(*value));
            warning = found.warning(no_background);
            if warning.is_some() {
                threshold = found.threshold();
                distinct = found.distinct;
                distinct.retain(|value| !is_background(*value));
            }
        } else if !pixels.contains(&true) {
            let wanted = match rule {
                MaskRule::NotZero => "other than 0".to_owned(),
                MaskRule::AtLeast(value) => format!("of at least {}", shown(value)),
                MaskRule::Equal(value) => shown(value),
            };
            let found = format!("no pixel with a value {wanted}");
            let expected = format!("one of {}", Values::of(values).names());
            return Err(IoError::new(path, None, found, expected));
        }
        let mask = Mask::new(image.width, image.height, pixels);
        let mask = mask.map_err(|error| IoError::unusable(path, "mask", error))?;
        Ok(Self {
            mask,
            warning,
            values: distinct,
            threshold,
        })
    }
}

/// Returns the value of every pixel.
fn values(image: &Raster) -> impl Iterator<Item = f64> + Clone {
    let pixels = image.samples.chunks_exact(image.channels);
    let colors = image.channels - usize::from(image.has_alpha);
    let opacity = pixels.clone().map(move |pixel| pixel[colors..].first());
    let first = opacity.clone().next().flatten();
    let varies = image.has_alpha && opacity.clone().any(|alpha| alpha != first);
    // Only the upper 8 bits of a color count.
    let shift = if image.integer_bits == Some(16) {
        256.0
    } else {
        1.0
    };
    pixels.map(move |pixel| match pixel {
        [.., alpha] if varies => f64::from(*alpha),
        [red, green, blue, ..] if !(red == green && green == blue) => {
            let [red, green, blue] = [red, green, blue].map(|x| f64::from(x / shift).floor());
            MaskRule::COLOR + 65536.0 * red + 256.0 * green + blue
        }
        // NaN is no object.
        [gray, ..] if !gray.is_nan() => f64::from(*gray),
        _ => 0.0,
    })
}

/// Returns the value as a message shows it.
fn shown(value: f64) -> String {
    match value.abs() {
        color if (MaskRule::COLOR..2.0 * MaskRule::COLOR).contains(&color) => {
            format!("#{:06x}", whole(color - MaskRule::COLOR))
        }
        0.0 | 1e-4..1e9 => narrow(value).to_string(),
        _ => format!("{value:e}"),
    }
}

/// The largest number of distinct values that are counted.
const COUNTED: usize = 256;

/// The distinct values of a mask.
struct Values {
    /// In ascending order, with the smallest and the largest one.
    distinct: Vec<f64>,
    /// Whether there are more than [`COUNTED`].
    more: bool,
}

impl Values {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let (mut distinct, mut last, mut more) = (Vec::<f64>::new(), None, false);
        for value in values {
            // Neighbors are mostly equal.
            if last.replace(value) != Some(value)
                && let Err(at) = distinct.binary_search_by(|other| other.total_cmp(&value))
            {
                if distinct.len() < COUNTED {
                    distinct.insert(at, value);
                    continue;
                }
                // The first and the last value are those of the whole image.
                more = true;
                match at {
                    0 => distinct[0] = value,
                    COUNTED => distinct[COUNTED - 1] = value,
                    _ => {}
                }
            }
        }
        Self { distinct, more }
    }

    /// Lists the values, or their range if they are many.
    fn names(&self) -> String {
        let names: Vec<String> = self.distinct.iter().map(|value| shown(*value)).collect();
        let more = if self.more { "more than " } else { "" };
        match &names[..] {
            [all @ .., last] if all.len() < 8 && !all.is_empty() => {
                format!("the values {} and {last}", all.join(", "))
            }
            [only] => format!("the value {only}"),
            [first, .., last] => format!("{more}{} values from {first} to {last}", names.len()),
            [] => "no values".to_owned(),
        }
    }

    fn warning(&self, no_background: bool) -> Option<String> {
        let count = self.distinct.len();
        if count <= 2 && !(count == 2 && no_background) {
            return None;
        }
        let has_colors = self.distinct.last() >= Some(&MaskRule::COLOR);
        let photo = if self.more && has_colors {
            ", as in a photo"
        } else {
            ""
        };
        Some(format!(
            "{}{photo}, and all but 0 count as the object: choose with --mask-threshold {} (at least) or \
             --mask-value N (a label)",
            self.names(),
            shown(self.threshold())
        ))
    }

    /// Returns the least value on the object of a soft mask, with at most three digits.
    fn threshold(&self) -> f64 {
        let value = |at: Option<&f64>| at.copied().unwrap_or(1.0);
        match (value(self.distinct.first()), value(self.distinct.last())) {
            (..0.0, _) => 0.0,
            (_, MaskRule::COLOR..) => 1.0,
            // Half of 255 is 128, and half of 1 is 0.5.
            (_, most) if most > 1.0 => (most / 2.0).ceil(),
            (_, most) => format!("{:.2e}", most / 2.0).parse().unwrap_or(0.5),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_have_few_digits_and_follow_all_values() {
        let threshold = |most: f64| Values::of([0.0, most].into_iter()).threshold();
        let found = [f64::from(0.93_f32), 1.0, 3.0, 255.0].map(threshold);
        assert_eq!(found, [0.465, 0.5, 2.0, 128.0]);
        // The largest number is found after more than 256 others, and the smallest one after it.
        let many = (0..300).map(|i| 0.1 + 1e-4 * f64::from(i));
        let found = Values::of(many.chain([0.9, 0.05, 0.3]));
        assert!(found.names().ends_with("values from 0.05 to 0.9") && found.threshold() == 0.45);
    }
}
