//! How the estimates along a trajectory are fused.

use hicp_core::{Isometry3, Model};
use hybrid_icp::fusion::{
    CovarianceModel, FuserConfig, FusionError, FusionMethod, MveCovariance, UnitCovariance,
};
use hybrid_icp::{BoxedStage, MeanVsd, SequentialConfig, SequentialEstimator};

/// A method of §V-A as the study runs it, or one behind this project's gate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FusionRule {
    /// The paper's method: covariances e_MVE·U with U the unit about the object (rotations count by its radius), carried by the
    /// adjoint; no gate, no symmetries.
    Plain(FusionMethod),
    /// The same, but estimates with an MVE above 0.4 are left out and symmetric poses are brought together:
    /// [`SequentialEstimator::for_object`].
    Gated(FusionMethod),
}

impl FusionRule {
    /// The paper's six methods in its order, then what goes beyond it.
    pub const ALL: [Self; 8] = [
        Self::Plain(FusionMethod::LastEstimate),
        Self::Plain(FusionMethod::Average),
        Self::Plain(FusionMethod::WeightedAverage),
        Self::Plain(FusionMethod::FilteringConstant),
        Self::Plain(FusionMethod::Filtering),
        Self::Plain(FusionMethod::MostConfident),
        Self::Gated(FusionMethod::Average),
        Self::Gated(FusionMethod::WeightedAverage),
    ];

    /// Name in tables; `gated-` before that of the method.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Plain(method) => method.name().to_owned(),
            Self::Gated(method) => format!("gated-{method}"),
        }
    }

    /// Returns the rule of a name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == name)
    }

    /// Makes an estimator that starts from `init` in the first camera frame.
    pub(crate) fn estimator(
        self,
        stage: BoxedStage,
        model: &Model,
        init: &Isometry3<f64>,
    ) -> Result<SequentialEstimator, FusionError> {
        let method = match self {
            Self::Gated(method) => {
                return SequentialEstimator::for_object(stage, method, model, init);
            }
            Self::Plain(method) => method,
        };
        let unit = UnitCovariance::about_object(model.center(), model.radius())?;
        let fuser = method.build(FuserConfig {
            unit,
            ..FuserConfig::default()
        });
        let config = SequentialConfig {
            covariance: CovarianceModel::Mve(MveCovariance {
                unit,
                ..MveCovariance::default()
            }),
            score: method.uses_covariances().then(MeanVsd::default),
        };
        SequentialEstimator::new(stage, fuser, config, init)
    }
}
