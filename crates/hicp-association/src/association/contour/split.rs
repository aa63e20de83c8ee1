//! The place on a line that separates the object from the background.

use super::line::{LENGTH, Line, SIDE};

/// Number of pixels next to the split whose evidence must agree with it.
const NEXT: usize = 3;
/// Smallest contrast of a split that has a pair, and the contrast of a certain one.
const LEAST_CONTRAST: f64 = 1.5;
const CERTAIN_CONTRAST: f64 = 6.0;
/// Loss of evidence per step from the silhouette, so that of equal splits the nearest is chosen.
const PER_STEP: f64 = 0.05;

/// The last pixel of a line that shows the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Split {
    last: usize,
    /// The smaller sum of evidence over the pixels next to it, inside and outside.
    contrast: f64,
}

impl Split {
    /// Finds the split of the evidence along a line, or returns `None` if none is clear.
    pub(super) fn of(evidence: &[f64; LENGTH]) -> Option<Self> {
        let split = Self::best(evidence);
        let ends = split.last < 2 || split.last + NEXT >= LENGTH;
        (!ends && split.contrast >= LEAST_CONTRAST).then_some(split)
    }

    /// Returns the split with the most evidence inside and the least outside.
    fn best(evidence: &[f64; LENGTH]) -> Self {
        let (mut sum, mut best, mut last) = (0.0, f64::NEG_INFINITY, SIDE);
        for (index, value) in evidence[..LENGTH - 1].iter().enumerate() {
            sum += value;
            let gained = 2.0 * sum - PER_STEP * Line::steps(index).abs();
            if gained > best {
                (best, last) = (gained, index);
            }
        }
        let inside = &evidence[(last + 1).saturating_sub(NEXT)..=last];
        let outside = &evidence[last + 1..(last + 1 + NEXT).min(LENGTH)];
        let (inside, outside) = (inside.iter().sum::<f64>(), outside.iter().sum::<f64>());
        Self {
            last,
            contrast: inside.min(-outside),
        }
    }

    /// Returns the number of steps from the silhouette to the border.
    pub(super) fn offset(self) -> f64 {
        Line::steps(self.last)
    }

    /// Returns the certainty of the border, 0 to 1.
    pub(super) fn certainty(self) -> f64 {
        (self.contrast / CERTAIN_CONTRAST).clamp(0.0, 1.0)
    }

    /// Returns whether the evidence next to the border sums up to at least `contrast`.
    pub(super) fn has(self, contrast: f64) -> bool {
        self.contrast >= contrast
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_split_is_where_the_evidence_changes() {
        for last in 2..LENGTH - NEXT {
            let evidence = std::array::from_fn(|i| if i <= last { 3.0 } else { -3.0 });
            let split = Split::of(&evidence).expect("a clear border");
            assert_eq!(split.offset(), Line::steps(last));
            assert_eq!(split.certainty(), 1.0);
        }
    }

    #[test]
    fn without_a_change_there_is_no_split() {
        for value in [-3.0, 0.0, 3.0] {
            assert_eq!(Split::of(&[value; LENGTH]), None);
        }
        // One pixel is not enough.
        let evidence = std::array::from_fn(|i| if i == SIDE { 3.0 } else { 0.0 });
        assert_eq!(Split::of(&evidence), None);
    }
}
