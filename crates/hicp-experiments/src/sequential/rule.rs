//! The methods that fuse the estimates along a trajectory.

use hicp_core::{Isometry3, Model};
use hybrid_icp::fusion::{
    CovarianceModel, FuserConfig, FusionError, FusionMethod, MveCovariance, UnitCovariance,
    probability_within,
};
use hybrid_icp::score::MeanVsd;
use hybrid_icp::{BoxedStage, Calibration, Preset, SequentialConfig, SequentialEstimator};

/// A method of §V-A as the study runs it, or one behind a gate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FusionRule {
    /// The paper's method: covariances e_MVE·U with U the unit about the object (rotations count by
    /// its radius), carried by the adjoint; no gate, no symmetries.
    Plain(FusionMethod),
    /// The same, but estimates with an MVE above 0.4 are left out and symmetric poses are brought
    /// together: [`SequentialEstimator::for_object`].
    Gated(FusionMethod),
    /// As `Gated`, with the covariance of the registration, calibrated to the pipeline:
    /// [`SequentialEstimator::calibrated`].
    Calibrated(FusionMethod),
}

impl FusionRule {
    /// The paper's six methods in its order, then those beyond the paper.
    pub const ALL: [Self; 10] = [
        Self::Plain(FusionMethod::LastEstimate),
        Self::Plain(FusionMethod::Average),
        Self::Plain(FusionMethod::WeightedAverage),
        Self::Plain(FusionMethod::FilteringConstant),
        Self::Plain(FusionMethod::Filtering),
        Self::Plain(FusionMethod::MostConfident),
        Self::Gated(FusionMethod::Average),
        Self::Gated(FusionMethod::WeightedAverage),
        Self::Calibrated(FusionMethod::WeightedAverage),
        Self::Calibrated(FusionMethod::MostConfident),
    ];

    /// The expected names, for messages.
    pub(crate) const EXPECTED: &str =
        "a method of the paper, or one of those that gated- and calibrated- are put before";

    /// Name in tables; `gated-` or `calibrated-` before that of the method.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Plain(method) => method.name().to_owned(),
            Self::Gated(method) => format!("gated-{method}"),
            Self::Calibrated(method) => format!("calibrated-{method}"),
        }
    }

    /// Returns the rule of a name; any method may be gated or calibrated, not only those of
    /// [`FusionRule::ALL`].
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let of = |rule: fn(FusionMethod) -> Self, method: &str| method.parse().ok().map(rule);
        match name.split_once('-') {
            Some(("gated", method)) => of(Self::Gated, method),
            Some(("calibrated", method)) => of(Self::Calibrated, method),
            _ => of(Self::Plain, name),
        }
    }

    /// Returns whether it is a method of the paper.
    #[must_use]
    pub fn is_of_paper(self) -> bool {
        matches!(self, Self::Plain(_))
    }

    /// Returns the probability that the squared Mahalanobis distance of the final pose from the
    /// truth is at most this large.
    ///
    /// By the distribution that the rule assumes with an underlying pipeline.
    pub(crate) fn probability_within(self, pipeline: &str, mahalanobis_squared: f64) -> f64 {
        match self {
            Self::Calibrated(_) => calibration(pipeline).probability_within(mahalanobis_squared),
            _ => probability_within(mahalanobis_squared, f64::INFINITY),
        }
    }

    /// Creates an estimator that starts from `init` in the first camera frame; `pipeline` is the
    /// name of the underlying pipeline.
    pub(crate) fn estimator(
        self,
        stage: BoxedStage,
        pipeline: &str,
        model: &Model,
        init: &Isometry3<f64>,
    ) -> Result<SequentialEstimator, FusionError> {
        let method = match self {
            Self::Gated(method) => {
                return SequentialEstimator::for_object(stage, method, model, init);
            }
            Self::Calibrated(method) => {
                let calibration = calibration(pipeline);
                return SequentialEstimator::calibrated(stage, method, &calibration, model, init);
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

/// Returns the calibration for a pipeline by its name; that of `hybrid` if it is not a preset.
fn calibration(pipeline: &str) -> Calibration {
    Calibration::of(pipeline.parse().unwrap_or(Preset::Hybrid))
}
