//! The covariance of a single estimate, from its MVE and its registration.

use hicp_core::{Isometry3, Matrix6};

use crate::unit::UnitCovariance;

/// The default floor of e_MVE, which keeps an exact match (e_MVE = 0) invertible.
///
/// The paper does not state a floor.
// Open: value of the floor of e_MVE: §V. It limits the weight of an exact match.
pub const MVE_FLOOR: f64 = 1e-3;

/// The covariance e_MVE times a unit covariance: the paper's proxy (§V).
///
/// The paper calls it "not theoretically grounded". An unknown MVE counts as 1.
///
/// ```
/// use hicp_core::{Isometry3, Matrix6};
/// use hicp_fusion::MveCovariance;
/// let pose = Isometry3::translation(0.0, 0.0, 0.5);
/// let paper = MveCovariance::default();
/// assert_eq!(paper.covariance(&pose, Some(0.25)), Matrix6::identity() * 0.25);
/// assert_eq!(paper.covariance(&pose, Some(0.0)), Matrix6::identity() * 1e-3);
/// ```
// Deviation: floor of e_MVE: §V weighs by e_MVE as it is. Here e_MVE is at least 1e-3, because an
// exact match would weigh infinitely.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MveCovariance {
    /// The covariance at an MVE of 1.
    pub unit: UnitCovariance,
    /// Smallest factor, without unit like the MVE.
    pub floor: f64,
}

impl Default for MveCovariance {
    /// The paper's: I₆, with [`MVE_FLOOR`].
    fn default() -> Self {
        Self {
            unit: UnitCovariance::Identity,
            floor: MVE_FLOOR,
        }
    }
}

impl MveCovariance {
    /// Returns max(e_MVE, floor) times the unit covariance at the pose.
    #[must_use]
    pub fn covariance(
        &self,
        camera_from_object: &Isometry3<f64>,
        mve: Option<f64>,
    ) -> Matrix6<f64> {
        let floor = finite_or(self.floor, MVE_FLOOR).max(0.0);
        self.unit.at(camera_from_object) * known(mve).max(floor)
    }
}

/// The covariance of the registration, inflated by the MVE for wrong correspondences.
///
/// Σ = s² Σ_reg + (f² + (g e^p)²) U with the unit covariance U. Σ_reg (`Quality::covariance` of an
/// outcome) reflects which directions the geometry constrains, but assumes right pairs with
/// independent errors. The second term adds the rest: a floor of f units for systematic errors of
/// camera and model, and a share that grows with the MVE e. If the pairs leave a direction
/// undetermined, or the metric's policy freezes it, there is no Σ_reg, and `undetermined` units
/// replace f.
///
/// With `UnitCovariance::AboutObject`, a standard deviation of one unit is a radius and 1 rad.
/// **The defaults are not calibrated**: fit the factors to data with ground truth, until ξᵀΣ⁻¹ξ of
/// the errors is distributed like χ²₆.
// Deviation: covariance of the calibrated estimator: §V uses e_MVE·I₆.
// `SequentialEstimator::calibrated` inflates the covariance of the registration by the MVE, so that
// the stated covariance agrees with the errors.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InflatedCovariance {
    /// The unit of the factors below.
    pub unit: UnitCovariance,
    /// Factor s of the standard deviations of the registration.
    pub scale: f64,
    /// Smallest standard deviation f of any estimate, in units.
    pub floor: f64,
    /// Standard deviation g at an MVE of 1, in units.
    pub mve_gain: f64,
    /// Exponent p of the MVE.
    pub mve_power: f64,
    /// Standard deviation in units if the registration does not determine a covariance.
    pub undetermined: f64,
}

impl InflatedCovariance {
    /// Creates the model with plausible, uncalibrated factors.
    ///
    /// They are s = 3, f = 0.01, g = 1, p = 2, and 0.3 for `undetermined`.
    #[must_use]
    pub fn uncalibrated(unit: UnitCovariance) -> Self {
        Self {
            unit,
            scale: 3.0,
            floor: 0.01,
            mve_gain: 1.0,
            mve_power: 2.0,
            undetermined: 0.3,
        }
    }

    /// Returns Σ for an estimate with an MVE and the covariance of its registration.
    ///
    /// An unknown MVE counts as 1.
    #[must_use]
    pub fn covariance(
        &self,
        camera_from_object: &Isometry3<f64>,
        mve: Option<f64>,
        registration: Option<&Matrix6<f64>>,
    ) -> Matrix6<f64> {
        let share = finite_or(self.mve_gain * known(mve).powf(self.mve_power), 1.0);
        let floor = match registration {
            Some(_) => self.floor,
            None => self.undetermined,
        };
        let unit = self.unit.at(camera_from_object) * (floor * floor + share * share);
        match registration {
            Some(registration) => unit + registration * (self.scale * self.scale),
            None => unit,
        }
    }
}

/// The source of an estimate's covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum CovarianceModel {
    /// The same unit for every estimate.
    Constant(UnitCovariance),
    /// From the MVE, as in the paper.
    Mve(MveCovariance),
    /// From the registration, inflated by the MVE.
    Inflated(InflatedCovariance),
}

impl Default for CovarianceModel {
    /// The paper's model.
    fn default() -> Self {
        Self::Mve(MveCovariance::default())
    }
}

impl CovarianceModel {
    /// Returns the covariance of an estimate; see the variants.
    #[must_use]
    pub fn covariance(
        &self,
        camera_from_object: &Isometry3<f64>,
        mve: Option<f64>,
        registration: Option<&Matrix6<f64>>,
    ) -> Matrix6<f64> {
        match self {
            Self::Constant(unit) => unit.at(camera_from_object),
            Self::Mve(model) => model.covariance(camera_from_object, mve),
            Self::Inflated(model) => model.covariance(camera_from_object, mve, registration),
        }
    }
}

/// Returns the MVE, or 1 if it is unknown or invalid.
fn known(mve: Option<f64>) -> f64 {
    mve.filter(|e| (0.0..=1.0).contains(e)).unwrap_or(1.0)
}

fn finite_or(value: f64, other: f64) -> f64 {
    if value.is_finite() { value } else { other }
}
