//! Factors that match the covariance of a registration to its errors.

use hicp_fusion::{Gate, InflatedCovariance, UnitCovariance, probability_within};

use crate::preset::Preset;

/// Factors that match the covariance of a pipeline's registration to its errors.
///
/// They are the factors of [`InflatedCovariance`] in units of the object (its radius and 1 rad),
/// the error that all estimates along a trajectory share, and the tails of the errors.
///
/// The constants are fitted along trajectories toward the tuning objects, seen with the noise of a
/// D435, and reconstructed from such images with camera poses that are off by 5 mm and 1.1°
/// (`cargo run --release -p hicp-experiments --example calibration`). They hold for such models:
/// with an exact model the shared error is much smaller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Calibration {
    /// Factor on the standard deviations of the registration.
    pub scale: f64,
    /// Smallest standard deviation of an estimate, without the shared error.
    pub floor: f64,
    /// Standard deviation at an MVE of 1, in units of the object.
    pub mve_gain: f64,
    /// Exponent p: the standard deviation is `mve_gain` times the p-th power of the MVE.
    pub mve_power: f64,
    /// Standard deviation if neither the registration nor a fit at its pose has a covariance.
    pub undetermined: f64,
    /// Standard deviation of the error that all estimates share: that of the model.
    pub shared: f64,
    /// ν of Student's distribution of the errors; ∞ for normal errors. See
    /// [`Calibration::probability_within`].
    pub degrees_of_freedom: f64,
    /// The conditions that an estimate must meet to be fused.
    pub gate: Gate,
}

impl Calibration {
    /// The factors fitted to the preset `hybrid`.
    pub const HYBRID: Self = Self {
        scale: 1.0,
        floor: 0.003,
        mve_gain: 36.0,
        mve_power: 5.0,
        undetermined: 0.3,
        shared: 0.021,
        degrees_of_freedom: 4.0,
        gate: Gate {
            max_mve: Some(0.25),
            max_mahalanobis_squared: Some(100.0),
            restart_after: Some(3),
            // Typical of an arm: the hand-eye calibration, and the time of an image.
            camera_error_meters: 0.001,
            camera_error_radians: 0.002,
        },
    };

    /// The factors fitted to the preset `projective-cascade-point-plane`.
    pub const PROJECTIVE_CASCADE_POINT_PLANE: Self = Self {
        mve_gain: 18.0,
        mve_power: 4.4,
        ..Self::HYBRID
    };

    /// Returns the factors for a preset.
    ///
    /// Two presets have fitted factors, `hybrid` and `projective-cascade-point-plane`. For every
    /// other preset, they are those of `hybrid`.
    ///
    /// Factors fitted to `auto` differ by a tenth in the shared error and by a third in the growth
    /// with the MVE.
    #[must_use]
    pub fn of(preset: Preset) -> Self {
        match preset {
            Preset::ProjectiveCascadePointPlane => Self::PROJECTIVE_CASCADE_POINT_PLANE,
            _ => Self::HYBRID,
        }
    }

    /// Returns the covariance of an estimate without the shared error.
    #[must_use]
    pub fn covariance(&self, unit: UnitCovariance) -> InflatedCovariance {
        InflatedCovariance {
            unit,
            scale: self.scale,
            floor: self.floor,
            mve_gain: self.mve_gain,
            mve_power: self.mve_power,
            undetermined: self.undetermined,
        }
    }

    /// Returns the probability that the squared Mahalanobis distance of the fused pose from the
    /// truth, by the stated covariance, is at most `mahalanobis_squared`.
    #[must_use]
    pub fn probability_within(&self, mahalanobis_squared: f64) -> f64 {
        probability_within(mahalanobis_squared, self.degrees_of_freedom)
    }
}
