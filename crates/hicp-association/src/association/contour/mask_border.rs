//! The border of the mask, compared with the borders that depth shows.

use super::line::{LENGTH, Line};
use super::split::Split;

/// Fewest lines on which depth and mask both show a border.
const FEWEST: usize = 8;
/// Smallest contrast of a border in depth, and in the mask, that is compared.
const DEPTH_CONTRAST: f64 = 4.0;
const MASK_CONTRAST: f64 = 2.0;
/// Spread of the offsets if there are too few lines, steps.
const UNKNOWN_SPREAD: f64 = 4.0;
/// Evidence of an exact mask per pixel, and the spread at which it is halved.
const MOST: f64 = 1.5;
const HALVING_SPREAD: f64 = 1.5;

/// The offset of the mask's border from that of the object, and the trust in it.
#[derive(Debug, Default)]
pub(super) struct MaskBorder {
    offsets: Vec<i32>,
    offset: i32,
    evidence: f64,
}

impl MaskBorder {
    /// Measures the median offset over the lines, and its spread.
    pub(super) fn compare(&mut self, lines: &[Line]) {
        self.offsets.clear();
        self.offsets.extend(lines.iter().filter_map(|line| {
            let depth = Split::of(&line.depth).filter(|split| split.has(DEPTH_CONTRAST))?;
            let mask = Split::of(&line.mask).filter(|split| split.has(MASK_CONTRAST))?;
            #[allow(clippy::cast_possible_truncation)] // Below the length of a line.
            let steps = (mask.offset() - depth.offset()) as i32;
            Some(steps)
        }));
        let mut spread = UNKNOWN_SPREAD;
        self.offset = 0;
        if self.offsets.len() >= FEWEST {
            self.offsets.sort_unstable();
            let at = |tenths: usize| self.offsets[(self.offsets.len() - 1) * tenths / 10];
            self.offset = at(5);
            spread = f64::from(at(8) - at(2)) / 2.0;
        }
        self.evidence = MOST / (1.0 + (spread / HALVING_SPREAD).powi(2));
    }

    /// Returns the evidence of depth and mask along a line.
    pub(super) fn add_to(&self, line: &Line) -> [f64; LENGTH] {
        std::array::from_fn(|index| {
            let shifted = index.saturating_add_signed(self.offset as isize);
            line.depth[index] + self.evidence * line.mask[shifted.min(LENGTH - 1)]
        })
    }
}
