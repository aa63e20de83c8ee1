//! Run-length codes of masks, as in COCO.

use hicp_core::Mask;
use hicp_core::internal::index;
use serde::de::{Deserialize, Deserializer, Error as _};
use serde_json::Value;
use thiserror::Error;

use crate::limits::ReadLimits;

/// The largest number of pixels of a mask.
const MAX_PIXELS: u64 = ReadLimits::DEFAULT.max_pixels;

/// A mask as the lengths of its runs, column by column.
///
/// Runs alternate between background and object; the first is background.
///
/// ```
/// use hicp_io::bop::Rle;
/// # fn main() -> Result<(), hicp_io::bop::RleError> {
/// // Two columns of three rows; the object is the middle of the first and the top of the second.
/// let rle = Rle::from_counts(2, 3, vec![1, 1, 1, 1, 2])?;
/// assert_eq!(rle.to_mask().pixels(), [false, true, true, false, false, false]);
/// assert_eq!(rle.to_compressed(), "11101");
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rle {
    width: u32,
    height: u32,
    counts: Vec<u32>,
}

/// The reason why a run-length code does not describe a mask.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{found}, expected {expected}")]
#[non_exhaustive]
pub struct RleError {
    /// The value found.
    pub found: String,
    /// The expected value.
    pub expected: String,
}

fn refuse<T>(found: String, expected: impl Into<String>) -> Result<T, RleError> {
    let expected = expected.into();
    Err(RleError { found, expected })
}

impl Rle {
    /// Creates a code from the lengths of its runs, in pixels.
    ///
    /// # Errors
    ///
    /// [`RleError`] if the lengths do not sum to width × height. Also if the image has more pixels
    /// than `max_pixels` of [`ReadLimits::DEFAULT`].
    pub fn from_counts(width: u32, height: u32, counts: Vec<u32>) -> Result<Self, RleError> {
        let pixels = u64::from(width) * u64::from(height);
        if pixels > MAX_PIXELS {
            let found = format!("a mask of {width}x{height} pixels");
            return refuse(found, format!("at most {MAX_PIXELS}"));
        }
        let sum: u64 = counts.iter().map(|count| u64::from(*count)).sum();
        if sum != pixels {
            let found = format!("runs cover {sum} pixels");
            return refuse(found, format!("{pixels} for {width}x{height}"));
        }
        Ok(Self {
            width,
            height,
            counts,
        })
    }

    /// Creates a code from COCO's compressed text.
    ///
    /// The text stores numbers with five bits per character. From the fourth run on, a number is
    /// the difference to the run before the previous one.
    ///
    /// # Errors
    ///
    /// [`RleError`] for other text, and as [`Rle::from_counts`].
    pub fn from_compressed(width: u32, height: u32, text: &str) -> Result<Self, RleError> {
        let mut counts: Vec<u32> = Vec::new();
        let bad_run = |index| {
            let found =
                format!("run {index} of the compressed code is negative, too large or cut off");
            refuse(found, "a number of pixels")
        };
        let (mut value, mut shift) = (0_i64, 0_u32);
        for (offset, found) in text.char_indices() {
            let Some(code @ 0..64) = u32::from(found).checked_sub(48) else {
                return refuse(
                    format!("character {found:?} at byte {offset}"),
                    "'0' to 'o'",
                );
            };
            let index = counts.len();
            if shift > 50 {
                return bad_run(index);
            }
            value |= i64::from(code & 0x1f) << shift;
            shift += 5;
            if code & 0x20 != 0 {
                continue;
            }
            if code & 0x10 != 0 {
                value |= -1 << shift;
            }
            if index > 2 {
                value += i64::from(counts[index - 2]);
            }
            let Ok(count) = u32::try_from(value) else {
                return bad_run(index);
            };
            counts.push(count);
            (value, shift) = (0, 0);
        }
        if shift > 0 {
            return bad_run(counts.len());
        }
        Self::from_counts(width, height, counts)
    }

    /// Creates the run-length code of a mask.
    #[must_use]
    pub fn of_mask(mask: &Mask) -> Self {
        let (width, height) = (mask.width(), mask.height());
        let column = |u| (0..height).map(move |v| mask.get(u, v) == Some(true));
        let pixels: Vec<bool> = (0..width).flat_map(column).collect();
        // The first run is background, which may be empty.
        let empty = pixels.first().is_none_or(|first| *first).then_some(0);
        let runs = pixels.chunk_by(|a, b| a == b);
        let counts = empty.into_iter().chain(runs.map(|run| index(run.len())));
        Self {
            width,
            height,
            counts: counts.collect(),
        }
    }

    /// Width of the mask, pixels.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height of the mask, pixels.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Returns the lengths of the runs, in pixels.
    #[must_use]
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// Returns the mask. Cost: O(width × height).
    #[must_use]
    pub fn to_mask(&self) -> Mask {
        let (width, height) = (self.width as usize, self.height as usize);
        let mut columns = Vec::with_capacity(width * height);
        for (index, count) in self.counts.iter().enumerate() {
            columns.resize(columns.len() + *count as usize, index % 2 == 1);
        }
        let row = |v| (0..width).map(move |u| u * height + v);
        let pixels = (0..height).flat_map(row).map(|at| columns[at]);
        let Ok(mask) = Mask::new(self.width, self.height, pixels.collect()) else {
            unreachable!("the runs cover the image");
        };
        mask
    }

    /// Returns COCO's compressed text.
    #[must_use]
    pub fn to_compressed(&self) -> String {
        let mut text = String::new();
        for (index, count) in self.counts.iter().enumerate() {
            let mut value = i64::from(*count);
            if index > 2 {
                value -= i64::from(self.counts[index - 2]);
            }
            loop {
                let [bits, ..] = (value & 0x1f).to_le_bytes();
                value >>= 5;
                // The sign of the last five bits must be that of the number.
                let done = value == if bits & 0x10 == 0 { 0 } else { -1 };
                let code = if done { bits } else { bits | 0x20 };
                text.push(char::from(code + 48));
                if done {
                    break;
                }
            }
        }
        text
    }
}

impl<'de> Deserialize<'de> for Rle {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let code = Value::deserialize(deserializer)?;
        let (Some(size), Some(counts)) = (code.get("size"), code.get("counts")) else {
            let text = "another kind of segmentation, expected a run-length code with `size` and \
                        `counts`, such as that of annToRLE of pycocotools";
            return Err(D::Error::custom(text));
        };
        let [height, width] = Deserialize::deserialize(size).map_err(D::Error::custom)?;
        let rle = match counts {
            Value::String(text) => Self::from_compressed(width, height, text),
            counts => {
                let runs = Deserialize::deserialize(counts).map_err(D::Error::custom)?;
                Self::from_counts(width, height, runs)
            }
        };
        rle.map_err(|error| D::Error::custom(format!("a code that is not a mask: {error}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn masks_survive_encoding_and_decoding(
            width in 1_u32..40,
            height in 1_u32..40,
            seed in prop::collection::vec(any::<bool>(), 1600),
            long in any::<bool>(),
        ) {
            let count = (width * height) as usize;
            // Long runs need more than one character.
            let pixels = (0..count).map(|i| seed[if long { i / 97 } else { i }]).collect();
            let mask = Mask::new(width, height, pixels).unwrap();
            let rle = Rle::of_mask(&mask);
            prop_assert_eq!(&rle.to_mask(), &mask);
            let same = Rle::from_compressed(width, height, &rle.to_compressed()).unwrap();
            prop_assert_eq!(&same, &rle);
            prop_assert_eq!(&Rle::from_counts(width, height, rle.counts().to_vec()).unwrap(), &rle);
        }

        #[test]
        fn decoding_never_panics(text in "\\PC{0,40}") {
            let _ = Rle::from_compressed(4, 4, &text);
        }
    }

    #[test]
    fn a_code_computed_by_hand_is_decoded() {
        // 40 = 8 + 1·32 is "X1"; 3 and 5 are themselves; 1 follows as 1 − 3 = −2, which is 30 with
        // its sign bit: "N".
        let rle = Rle::from_compressed(7, 7, "X135N").unwrap();
        assert_eq!(rle.counts(), [40, 3, 5, 1]);
        assert_eq!(rle.to_compressed(), "X135N");
    }

    #[test]
    fn runs_are_column_by_column() {
        let rle = Rle::from_counts(3, 2, vec![0, 2, 3, 1]).unwrap();
        assert_eq!(
            rle.to_mask().pixels(),
            [true, false, false, true, false, true]
        );
    }

    #[test]
    fn codes_that_do_not_fit_their_image_are_refused() {
        for counts in [vec![], vec![3], vec![5, 2], vec![u32::MAX, u32::MAX]] {
            let error = Rle::from_counts(3, 2, counts).unwrap_err();
            assert_eq!(error.expected, "6 for 3x2", "{error}");
        }
        let error = Rle::from_counts(u32::MAX, u32::MAX, vec![]).unwrap_err();
        assert_eq!(error.expected, "at most 33554432");
        // One run of 8 pixels.
        let error = Rle::from_compressed(3, 2, "8").unwrap_err();
        assert_eq!(error.expected, "6 for 3x2", "{error}");
        for (text, found) in [
            ("1 2", "character ' ' at byte 1"),
            ("~", "character '~' at byte 0"),
        ] {
            let error = Rle::from_compressed(3, 2, text).unwrap_err();
            assert_eq!(error.found, found);
            assert!(error.expected.contains("'0' to 'o'"), "{error}");
        }
        for text in ["1X", "N", "oooooooooooooooooooo", "ooooooo?"] {
            let error = Rle::from_compressed(3, 2, text).unwrap_err();
            assert!(error.found.starts_with("run "), "{text}: {error}");
        }
    }
}
