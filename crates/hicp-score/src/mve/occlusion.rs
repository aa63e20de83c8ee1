//! The treatment of rendered pixels outside the mask.

/// BOP's visibility tolerance δ for every dataset but ITODD, meters.
// Open: δ of occluded pixels: §IV-A.2. BOP's visibility tolerance for its datasets.
pub const VISIBILITY_TOLERANCE_METERS: f64 = 0.015;

/// The rendered pixels outside the mask that count against a pose.
///
/// Distances are along the viewing ray. A negative `meters` counts as 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Occlusion {
    /// All rendered pixels outside the mask: the definition of §IV-A.
    Counted,
    /// The pixels that nothing hides.
    ///
    /// A pixel does not count if its measured surface is more than `meters` in front of the
    /// rendered one.
    Tolerated {
        /// The tolerance, meters.
        meters: f64,
    },
    /// The pixels that the camera sees through, for masks that miss a part of the object.
    ///
    /// A pixel counts only if it has no measurement, or if its measured surface is `meters` or more
    /// *behind* the rendered one.
    Lenient {
        /// The tolerance, meters.
        meters: f64,
    },
}

impl Default for Occlusion {
    /// [`Occlusion::Tolerated`] with [`VISIBILITY_TOLERANCE_METERS`].
    fn default() -> Self {
        Self::Tolerated {
            meters: VISIBILITY_TOLERANCE_METERS,
        }
    }
}

impl Occlusion {
    /// [`Occlusion::Lenient`] with [`VISIBILITY_TOLERANCE_METERS`].
    pub(crate) const LENIENT: Self = Self::Lenient {
        meters: VISIBILITY_TOLERANCE_METERS,
    };

    /// Converts the single number, in meters, of pipeline files and Python.
    ///
    /// A number below 0 is [`Occlusion::Lenient`]; infinity and NaN are [`Occlusion::Counted`].
    ///
    /// ```
    /// use hicp_score::Occlusion;
    /// assert_eq!(Occlusion::from_tolerance(0.015), Occlusion::default());
    /// assert_eq!(Occlusion::from_tolerance(-0.02), Occlusion::Lenient { meters: 0.02 });
    /// assert_eq!(Occlusion::from_tolerance(f64::INFINITY), Occlusion::Counted);
    /// ```
    #[must_use]
    pub fn from_tolerance(meters: f64) -> Self {
        if !meters.is_finite() {
            Self::Counted
        } else if meters < 0.0 {
            Self::Lenient { meters: -meters }
        } else {
            Self::Tolerated { meters }
        }
    }

    /// Returns the distance behind the measured surface from which on a rendered one does not
    /// count, meters.
    pub(crate) fn least_distance_behind(self) -> f64 {
        match self {
            Self::Counted => f64::INFINITY,
            Self::Tolerated { meters } => meters.max(0.0),
            Self::Lenient { meters } => -meters.max(0.0),
        }
    }
}
