//! The options of the methods of §V-A.

use crate::motion::Transport;
use crate::solution::FusionLimits;
use crate::unit::UnitCovariance;

/// Options of the six methods. Any value is valid.
///
/// The defaults are the paper's, except that covariances are transported by the adjoint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FuserConfig {
    /// The transport of covariances when the camera moves.
    pub transport: Transport,
    /// The covariance of every estimate in `average` and `filtering-constant`.
    pub unit: UnitCovariance,
    /// The limits of the iteration.
    pub limits: FusionLimits,
    /// Largest number of held estimates in `average` and `weighted-average`; `None` for all.
    ///
    /// The newest ones are held, and at least one.
    pub window: Option<usize>,
}

impl FuserConfig {
    /// Creates the plain reading of §V.
    ///
    /// Covariances are I₆ and e_MVE·I₆, and do not change when the camera moves.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            transport: Transport::Kept,
            ..Self::default()
        }
    }
}
