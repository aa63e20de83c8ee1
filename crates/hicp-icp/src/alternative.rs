//! Other poses that explain an image.

use hicp_core::Isometry3;

/// A pose that a search found in addition to the one that it returned.
///
/// It differs from the returned pose, and from other alternatives, by an MSSD of more than a tenth
/// of the diameter. MSSD and angle are up to declared symmetries.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Alternative {
    /// The pose `camera_from_object`, meters.
    pub camera_from_object: Isometry3<f64>,
    /// The score of the search for the pose; lower is better.
    pub score: f64,
    /// The score minus that of the returned pose.
    ///
    /// It is negative if the pose is better, but by less than the gain that a search requires.
    pub gap: f64,
    /// The agreement of the colors at the returned pose minus that at this one, as correlations.
    ///
    /// From 0.15 on, colors tell the poses apart. `None` if there are no colors, or none that tell
    /// poses apart.
    pub color_gap: Option<f64>,
    /// MSSD from the returned pose, meters, by samples of the surface: up to a tenth too low.
    pub mssd_meters: f64,
    /// Smallest angle to the rotation of the returned pose, degrees.
    pub rotation_degrees: f64,
}

impl Alternative {
    /// The gap in score within which two poses explain the image equally well.
    pub const AMBIGUOUS_GAP: f64 = 0.01;
    /// The gap in the agreement of colors from which on colors tell two poses apart.
    const COLOR_GAP: f64 = 0.15;
    /// The largest likelihood. Errors of the sensor can lower the score of a wrong pose.
    const MOST_LIKELY: f64 = 2.0;

    /// Returns how likely a pose is right, relative to one whose score is lower by `gap`.
    ///
    /// It is exp(−gap / [`Self::AMBIGUOUS_GAP`]), at most 2.
    #[must_use]
    pub(crate) fn likelihood_of(gap: f64) -> f64 {
        (-gap / Self::AMBIGUOUS_GAP).exp().min(Self::MOST_LIKELY)
    }

    /// Returns how likely the pose is right, relative to the returned one: 1 if both scores are
    /// equal, at most 2, and 0 if colors tell them apart.
    #[must_use]
    pub fn likelihood(&self) -> f64 {
        if self.is_told_apart() {
            0.0
        } else {
            Self::likelihood_of(self.gap)
        }
    }

    /// Returns whether the pose explains the image as well as the returned one, in depth and color.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        self.gap < Self::AMBIGUOUS_GAP && !self.is_told_apart()
    }

    /// Returns whether colors tell the pose apart from the returned one.
    fn is_told_apart(&self) -> bool {
        self.color_gap.is_some_and(|gap| gap >= Self::COLOR_GAP)
    }
}
