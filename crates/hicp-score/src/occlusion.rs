//! Whether rendered pixels outside the mask count against a pose.

/// BOP's visibility tolerance δ for every dataset but ITODD, meters.
pub const VISIBILITY_TOLERANCE_METERS: f64 = 0.015;

/// Which rendered pixels outside the mask count against a pose.
///
/// Distances are along the viewing ray. A negative `meters` counts as 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Occlusion {
    /// All of them: the definition of §IV-A.
    Counted,
    /// Those that nothing hides: pixels whose measured surface is more than `meters` in front of
    /// the rendered one do not count.
    Tolerated {
        /// The tolerance.
        meters: f64,
    },
    /// Those that the camera sees through: only pixels without a measurement, or whose measured
    /// surface is `meters` or more *behind* the rendered one, count. For masks that miss a part of
    /// the object.
    Lenient {
        /// The tolerance.
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

    /// Reads the one number, in meters, that pipeline files and Python use.
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

    /// Returns by how much, in meters, a rendered surface must be behind the measured one not to
    /// count.
    pub(crate) fn least_distance_behind(self) -> f64 {
        match self {
            Self::Counted => f64::INFINITY,
            Self::Tolerated { meters } => meters.max(0.0),
            Self::Lenient { meters } => -meters.max(0.0),
        }
    }
}
