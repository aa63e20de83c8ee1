//! Run-length codes of masks, as in COCO.

use hicp_core::Mask;
use serde::de::{Deserialize, Deserializer, Error as _};
use serde_json::Value;
use thiserror::Error;

use crate::image::MAX_IMAGE_PIXELS;

/// A mask as the lengths of its runs, column by column, alternating between background and object, background first.
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

/// A run-length code that does not describe a mask.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum RleError {
    /// The runs do not fill the image, or overrun it.
    #[error("runs cover {found} pixels, expected {expected} for {width}x{height}")]
    Coverage {
        /// Sum of the runs, up to the one that overran.
        found: u64,
        /// width × height.
        expected: u64,
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// More pixels than an image may have.
    #[error(
        "mask of {width}x{height} pixels, expected at most {}",
        MAX_IMAGE_PIXELS
    )]
    TooLarge {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// A character that no compressed code contains.
    #[error("character {found:?} at byte {offset}, expected '0' to 'o'")]
    Character {
        /// Offset in the text, bytes.
        offset: usize,
        /// The character.
        found: char,
    },
    /// A compressed number that is negative, too large, or cut off.
    #[error(
        "run {index} of the compressed code is negative, too large or cut off, expected a number of pixels"
    )]
    Number {
        /// Index of the run.
        index: usize,
    },
}

impl Rle {
    /// Makes a code from the lengths of its runs.
    ///
    /// # Errors
    ///
    /// [`RleError::Coverage`] when they do not sum to width × height, [`RleError::TooLarge`] for more than
    /// [`MAX_IMAGE_PIXELS`].
    pub fn from_counts(width: u32, height: u32, counts: Vec<u32>) -> Result<Self, RleError> {
        let expected = u64::from(width) * u64::from(height);
        if expected > MAX_IMAGE_PIXELS {
            return Err(RleError::TooLarge { width, height });
        }
        let mut found = 0;
        for count in &counts {
            found += u64::from(*count);
            if found > expected {
                break;
            }
        }
        if found != expected {
            return Err(RleError::Coverage {
                found,
                expected,
                width,
                height,
            });
        }
        Ok(Self {
            width,
            height,
            counts,
        })
    }

    /// Makes a code from COCO's compressed text: numbers of five bits per character, from the fourth on as differences to the last but one.
    ///
    /// # Errors
    ///
    /// [`RleError`] for text that is no such code, and as [`Rle::from_counts`].
    pub fn from_compressed(width: u32, height: u32, text: &str) -> Result<Self, RleError> {
        let mut counts: Vec<u32> = Vec::new();
        let (mut value, mut shift) = (0_i64, 0_u32);
        for (offset, found) in text.char_indices() {
            let code = u32::from(found)
                .checked_sub(48)
                .filter(|code| *code < 64)
                .ok_or(RleError::Character { offset, found })?;
            let index = counts.len();
            if shift > 50 {
                return Err(RleError::Number { index });
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
            counts.push(u32::try_from(value).map_err(|_| RleError::Number { index })?);
            (value, shift) = (0, 0);
        }
        if shift > 0 {
            let index = counts.len();
            return Err(RleError::Number { index });
        }
        Self::from_counts(width, height, counts)
    }

    /// Makes the code of a mask.
    #[must_use]
    pub fn of_mask(mask: &Mask) -> Self {
        let (width, height) = (mask.width(), mask.height());
        let mut counts = vec![0];
        let mut current = false;
        for u in 0..width {
            for v in 0..height {
                let set = mask.get(u, v).unwrap_or(false);
                if set != current {
                    counts.push(0);
                    current = set;
                }
                if let Some(last) = counts.last_mut() {
                    *last += 1;
                }
            }
        }
        Self {
            width,
            height,
            counts,
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

    /// The lengths of the runs.
    #[must_use]
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// Returns the mask. Cost: O(width × height).
    #[must_use]
    pub fn to_mask(&self) -> Mask {
        let (width, height) = (self.width as usize, self.height as usize);
        let mut pixels = vec![false; width * height];
        let mut at = 0;
        for (index, count) in self.counts.iter().enumerate() {
            let end = at + *count as usize;
            // Column by column.
            while index % 2 == 1 && at < end {
                let (column, row) = (at / height, at % height);
                let rows = (height - row).min(end - at);
                for row in row..row + rows {
                    pixels[row * width + column] = true;
                }
                at += rows;
            }
            at = end;
        }
        // The number of pixels is that of the image, so this is always the mask.
        Mask::new(self.width, self.height, pixels).unwrap_or_else(|_| Mask::full(0, 0))
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
                let bits = u8::try_from(value & 0x1f).unwrap_or(0);
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
            let text =
                "another kind of segmentation, expected a run-length code with `size` and `counts`";
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
        fn masks_come_back(
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
        fn no_text_panics(text in "\\PC{0,40}") {
            let _ = Rle::from_compressed(4, 4, &text);
        }
    }

    #[test]
    fn a_code_worked_out_by_hand() {
        // 40 = 8 + 1·32 is "X1"; 3 and 5 are themselves; 1 follows as 1 − 3 = −2, which is 30 with its sign bit: "N".
        let rle = Rle::from_compressed(7, 7, "X135N").unwrap();
        assert_eq!(rle.counts(), [40, 3, 5, 1]);
        assert_eq!(rle.to_compressed(), "X135N");
    }

    #[test]
    fn runs_go_down_the_columns() {
        let rle = Rle::from_counts(3, 2, vec![0, 2, 3, 1]).unwrap();
        assert_eq!(
            rle.to_mask().pixels(),
            [true, false, false, true, false, true]
        );
    }

    #[test]
    fn codes_that_do_not_fit_are_refused() {
        for counts in [vec![], vec![3], vec![5, 2], vec![u32::MAX, u32::MAX]] {
            assert!(matches!(
                Rle::from_counts(3, 2, counts),
                Err(RleError::Coverage { expected: 6, .. })
            ));
        }
        assert!(matches!(
            Rle::from_counts(u32::MAX, u32::MAX, vec![]),
            Err(RleError::TooLarge { .. })
        ));
        assert!(matches!(
            Rle::from_compressed(3, 2, "1 2"),
            Err(RleError::Character {
                offset: 1,
                found: ' '
            })
        ));
        for text in ["1X", "N", "oooooooooooooooooooo", "ooooooo?"] {
            assert!(
                matches!(
                    Rle::from_compressed(3, 2, text),
                    Err(RleError::Number { .. })
                ),
                "{text}"
            );
        }
    }
}
