//! What the methods of §V-A are made with.

use crate::motion::Transport;
use crate::solution::FusionLimits;
use crate::unit::UnitCovariance;

/// Options of the six methods. Any value is valid; the default is the paper's reading, but for
/// covariances carried by the adjoint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FuserConfig {
    /// What happens to covariances when the camera moves.
    pub transport: Transport,
    /// The covariance that `average` and `filtering-constant` give to every estimate.
    pub unit: UnitCovariance,
    /// When the iteration ends.
    pub limits: FusionLimits,
    /// The most estimates that `average` and `weighted-average` hold, the newest; all of them where
    /// `None`. At least one is held.
    pub window: Option<usize>,
}

impl FuserConfig {
    /// The plain reading of §V: covariances are I₆ and e_MVE·I₆, and stay as they are when the
    /// camera moves.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            transport: Transport::Kept,
            ..Self::default()
        }
    }
}
