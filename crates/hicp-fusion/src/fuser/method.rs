//! The six methods of the paper by name.

use std::str::FromStr;

use hicp_core::UnknownName;
use hicp_core::internal::named;

use crate::fuser::batch::BatchFuser;
use crate::fuser::config::FuserConfig;
use crate::fuser::fuser_trait::Fuser;
use crate::fuser::recursive::RecursiveFuser;
use crate::fuser::single::{LastEstimate, MostConfident};

/// A boxed fuser, with the same bits as without the box.
pub type BoxedFuser = Box<dyn Fuser + Send>;

/// A method of §V-A, by its name in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum FusionMethod {
    /// Returns the latest estimate ([`LastEstimate`]).
    LastEstimate,
    /// Fuses all estimates with equal weights ([`BatchFuser::average`]).
    Average,
    /// Fuses all estimates, weighted by their covariances ([`BatchFuser::weighted_average`]).
    WeightedAverage,
    /// Fuses each estimate with the result before, with a unit covariance
    /// ([`RecursiveFuser::filtering_constant`]).
    FilteringConstant,
    /// Fuses each estimate with the result before, with its own covariance
    /// ([`RecursiveFuser::filtering`]).
    Filtering,
    /// Returns the estimate with the lowest uncertainty so far ([`MostConfident`]).
    MostConfident,
}

impl FusionMethod {
    /// Every method, in the paper's order.
    pub const ALL: [Self; 6] = [
        Self::LastEstimate,
        Self::Average,
        Self::WeightedAverage,
        Self::FilteringConstant,
        Self::Filtering,
        Self::MostConfident,
    ];

    /// Returns the name on the command line and in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.texts().0
    }

    /// Returns a one-line description.
    #[must_use]
    pub fn summary(self) -> &'static str {
        self.texts().1
    }

    fn texts(self) -> (&'static str, &'static str) {
        match self {
            Self::LastEstimate => ("last-estimate", "the latest estimate"),
            Self::Average => ("average", "all estimates, with equal weights"),
            Self::WeightedAverage => (
                "weighted-average",
                "all estimates, weighted by their covariances",
            ),
            Self::FilteringConstant => (
                "filtering-constant",
                "the latest estimate with a unit covariance, fused with the previous result",
            ),
            Self::Filtering => (
                "filtering",
                "the latest estimate with its covariance, fused with the previous result",
            ),
            Self::MostConfident => (
                "most-confident",
                "the estimate with the lowest uncertainty so far",
            ),
        }
    }

    /// Returns whether the result depends on the covariances of the estimates.
    ///
    /// In the paper, these methods need an MVE.
    #[must_use]
    pub fn uses_covariances(self) -> bool {
        matches!(
            self,
            Self::WeightedAverage | Self::Filtering | Self::MostConfident
        )
    }

    /// Creates the fuser of this method.
    #[must_use]
    pub fn build(self, config: FuserConfig) -> BoxedFuser {
        match self {
            Self::LastEstimate => Box::new(LastEstimate::new(config.transport)),
            Self::Average => Box::new(BatchFuser::average(config)),
            Self::WeightedAverage => Box::new(BatchFuser::weighted_average(config)),
            Self::FilteringConstant => Box::new(RecursiveFuser::filtering_constant(config)),
            Self::Filtering => Box::new(RecursiveFuser::filtering(config)),
            Self::MostConfident => Box::new(MostConfident::new(config.transport)),
        }
    }
}

/// A value that becomes a fuser: a [`FusionMethod`], or any [`Fuser`].
///
/// Constructors accept it, so that a method can be built with options that follow from the object.
///
/// ```
/// use hicp_fusion::{Fuser, FuserConfig, FusionMethod, IntoFuser, LastEstimate, Transport};
/// let config = FuserConfig::default();
/// let method = FusionMethod::LastEstimate.into_fuser(config);
/// let own = LastEstimate::new(Transport::Adjoint).into_fuser(config);
/// assert_eq!(method.name(), own.name());
/// ```
pub trait IntoFuser {
    /// Returns the fuser. A method is built with `config`; a fuser is returned as it is.
    fn into_fuser(self, config: FuserConfig) -> BoxedFuser;
}

impl IntoFuser for FusionMethod {
    fn into_fuser(self, config: FuserConfig) -> BoxedFuser {
        self.build(config)
    }
}

impl<F: Fuser + Send + 'static> IntoFuser for F {
    fn into_fuser(self, _: FuserConfig) -> BoxedFuser {
        Box::new(self)
    }
}

impl std::fmt::Display for FusionMethod {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for FusionMethod {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        named("fusion method", name, &Self::ALL, Self::name)
    }
}
