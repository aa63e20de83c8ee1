//! The covariance of a single estimate, from what is known about it.

use hicp_core::{Isometry3, Matrix6};

use crate::unit::UnitCovariance;

/// The paper's floor is open; this one keeps an exact match (e_MVE = 0) invertible.
pub const MVE_FLOOR: f64 = 1e-3;

/// e_MVE times a unit covariance: the paper's proxy (§V), which it calls "not theoretically
/// grounded".
///
/// An MVE that is not known counts as 1.
///
/// ```
/// use hicp_core::{Isometry3, Matrix6};
/// use hicp_fusion::MveCovariance;
/// let pose = Isometry3::translation(0.0, 0.0, 0.5);
/// let paper = MveCovariance::default();
/// assert_eq!(paper.covariance(&pose, Some(0.25)), Matrix6::identity() * 0.25);
/// assert_eq!(paper.covariance(&pose, Some(0.0)), Matrix6::identity() * 1e-3);
/// ```
// Deviation: §V weighs by e_MVE as it is; an exact match would weigh infinitely, so e_MVE is floored at 1e-3.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MveCovariance {
    /// What an MVE of 1 means.
    pub unit: UnitCovariance,
    /// Smallest factor, dimensionless like the MVE.
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

/// The covariance of the registration itself, inflated by what the MVE says about wrong
/// correspondences.
///
/// Σ = s² Σ_reg + (f² + (g e^p)²) U with U the unit covariance. Σ_reg (`Quality::covariance` of an
/// outcome) knows which directions the geometry constrains, but assumes that the pairs are right
/// and their errors independent; the second term is what it does not know: a floor of f units that
/// no image is better than (systematic errors of camera and model), and a share that grows with the
/// MVE e. Where the pairs leave a direction open there is no Σ_reg, and the share is `undetermined`
/// units instead of f.
///
/// With `UnitCovariance::AboutObject` a standard deviation of one unit is a radius and 1 rad. **The
/// defaults are not calibrated**: fit the factors where the truth is known, until ξᵀΣ⁻¹ξ of the
/// errors is distributed like χ²₆.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InflatedCovariance {
    /// What one unit of the factors below means.
    pub unit: UnitCovariance,
    /// s, factor on the standard deviations of the registration.
    pub scale: f64,
    /// f, standard deviation in units that no estimate is better than.
    pub floor: f64,
    /// g, standard deviation in units at an MVE of 1.
    pub mve_gain: f64,
    /// p, how fast it grows with the MVE.
    pub mve_power: f64,
    /// Standard deviation in units where the registration determines no covariance.
    pub undetermined: f64,
}

impl InflatedCovariance {
    /// Makes the model with plausible, uncalibrated factors: s = 3, f = 0.01, g = 1, p = 2,
    /// undetermined 0.3.
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

    /// Returns Σ for an estimate with the given MVE (1 where not known) and covariance of the
    /// registration.
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

/// Where the covariance of an estimate comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum CovarianceModel {
    /// A unit for every estimate.
    Constant(UnitCovariance),
    /// From the MVE alone, as in the paper.
    Mve(MveCovariance),
    /// From the registration, inflated by the MVE.
    Inflated(InflatedCovariance),
}

impl Default for CovarianceModel {
    /// The paper's.
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

/// An MVE that is not known, or is none, says nothing for the estimate.
fn known(mve: Option<f64>) -> f64 {
    mve.filter(|e| (0.0..=1.0).contains(e)).unwrap_or(1.0)
}

fn finite_or(value: f64, other: f64) -> f64 {
    if value.is_finite() { value } else { other }
}
