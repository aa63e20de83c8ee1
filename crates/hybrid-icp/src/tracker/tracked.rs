//! The parameters and the results of a tracker.

use hicp_core::{ImageError, Isometry3, Vector3};
use hicp_score::Evidence;
use thiserror::Error;

/// The parameters of a [`Tracker`](crate::Tracker).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TrackerConfig {
    /// Typical speed of the object relative to the camera, m/s.
    pub meters_per_second: f64,
    /// Typical angular speed, degrees per second.
    pub degrees_per_second: f64,
    /// The time in which the object changes its velocity, seconds.
    pub memory_seconds: f64,
    /// The time for which an object that is not seen stays [`TrackState::Doubtful`], seconds.
    pub coast_seconds: f64,
}

impl Default for TrackerConfig {
    /// 0.3 m/s and 90°/s, changing within 0.5 s. An object that is not seen for 0.1 s is lost.
    fn default() -> Self {
        Self {
            meters_per_second: 0.3,
            degrees_per_second: 90.0,
            memory_seconds: 0.5,
            coast_seconds: 0.1,
        }
    }
}

/// The reason why [`Tracker::step`](crate::Tracker::step) refuses an image.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum TrackError {
    /// The sizes of the image, the mask and the camera differ.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The time is negative or not finite.
    #[error("seconds is {found}, expected the seconds since the previous image, 0 or more")]
    Seconds {
        /// The time given.
        found: f64,
    },
}

/// The degree of trust in the pose of a [`Tracked`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum TrackState {
    /// The image shows the object at the pose.
    Tracking,
    /// The pose may be wrong: the image does not determine it, or has not shown it for some frames.
    Doubtful,
    /// The object is not seen. The pose is a guess from its last motion.
    Lost,
}

impl TrackState {
    /// Returns the name in files: the word in lower case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tracking => "tracking",
            Self::Doubtful => "doubtful",
            Self::Lost => "lost",
        }
    }
}

/// The pose of the object in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Tracked {
    /// The pose, meters.
    pub camera_from_object: Isometry3<f64>,
    /// The degree of trust in the pose.
    pub state: TrackState,
    /// The probability that the pose is right, 0 to 1, by the evidence alone
    /// ([`Confidence`](hicp_score::Confidence)).
    ///
    /// Poses that look alike do not lower it. The motion tells them apart, or the state is
    /// [`TrackState::Doubtful`]. It is 0 if the object is not seen.
    pub confidence: f64,
    /// The velocity of the object's center relative to the camera, m/s, in the camera frame.
    ///
    /// It is that of the motion filter. While the object is not seen, it decays to 0.
    pub meters_per_second: Vector3<f64>,
    /// The angular velocity of the object relative to the camera, rad/s, in the camera frame.
    pub radians_per_second: Vector3<f64>,
    /// The evidence for and against the pose.
    ///
    /// It is measured at the registered pose. The filter moves that by at most four standard
    /// deviations of the registration.
    pub evidence: Evidence,
    /// Standard deviation of the least determined displacement of the object, meters.
    ///
    /// Rotations count by the distance of the surface from their axis, and those around declared
    /// axes of symmetry do not count. It comes from the motion and the registration, without errors
    /// of the model.
    pub deviation_meters: f64,
}
