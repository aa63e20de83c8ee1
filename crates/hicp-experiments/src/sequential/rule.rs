//! The methods that fuse the estimates along a trajectory.

use hicp_core::{Isometry3, Model};
use hybrid_icp::fusion::{
    CovarianceModel, FuserConfig, FusionError, FusionMethod, MveCovariance, UnitCovariance,
    probability_within,
};
use hybrid_icp::score::MeanVsd;
use hybrid_icp::{
    BoxedStage, Calibration, Preset, SequentialConfig, SequentialEstimator, WithoutPairs,
};
use serde::{Deserialize, Serialize};

/// The covariances that the paper's methods fuse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlainCovariance {
    /// e_MVE·I₆, which stays as it is when the camera moves (§V).
    Identity,
    /// e_MVE·U with the unit covariance U around the object's center, transformed by the adjoint
    /// when the camera moves.
    AboutObject,
}

/// A fusion method of §V-A as the study runs it, with or without a gate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FusionRule {
    /// The paper's method, without a gate and without symmetries.
    ///
    /// The configuration of a study chooses its covariances and what it fuses without pairs.
    Plain(FusionMethod),
    /// The same with a gate and with symmetries: [`SequentialEstimator::for_object`].
    ///
    /// Estimates with an MVE above 0.4 are left out.
    Gated(FusionMethod),
    /// Like `Gated`, with the calibrated covariance of the registration.
    ///
    /// See [`SequentialEstimator::calibrated`]. The calibration depends on the pipeline.
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
        "a method of the paper, with or without gated- or calibrated- before its name";

    /// Returns the name in tables: that of the method, after `gated-` or `calibrated-` if it has a
    /// gate.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Plain(method) => method.name().to_owned(),
            Self::Gated(method) => format!("gated-{method}"),
            Self::Calibrated(method) => format!("calibrated-{method}"),
        }
    }

    /// Returns the rule of a name.
    ///
    /// Any method may be gated or calibrated, not only those of [`FusionRule::ALL`].
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

    /// Returns the probability of a smaller squared Mahalanobis distance from the truth.
    ///
    /// The distribution is the one that the rule assumes for an underlying pipeline.
    pub(crate) fn probability_within(self, pipeline: &str, mahalanobis_squared: f64) -> f64 {
        match self {
            Self::Calibrated(_) => calibration(pipeline).probability_within(mahalanobis_squared),
            _ => probability_within(mahalanobis_squared, f64::INFINITY),
        }
    }

    /// Returns whether every estimate needs an MVE.
    pub(crate) fn uses_mve(self) -> bool {
        match self {
            Self::Plain(method) => method.uses_covariances(),
            Self::Gated(_) | Self::Calibrated(_) => true,
        }
    }

    /// Creates an estimator that starts from `init` in the first camera frame.
    ///
    /// Methods of the paper fuse `covariance`, and `without_pairs` if ICP finds none. `stage` is
    /// that of an underlying pipeline.
    pub(crate) fn estimator(
        self,
        (covariance, without_pairs): (PlainCovariance, WithoutPairs),
        (pipeline, stage): (&str, BoxedStage),
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

        let (fuser, score) = match covariance {
            PlainCovariance::Identity => (FuserConfig::paper(), MeanVsd::paper()),
            PlainCovariance::AboutObject => {
                let unit = UnitCovariance::about_object(model.center(), model.radius())?;
                (
                    FuserConfig {
                        unit,
                        ..FuserConfig::default()
                    },
                    MeanVsd::default(),
                )
            }
        };
        let sequential = SequentialConfig {
            covariance: CovarianceModel::Mve(MveCovariance {
                unit: fuser.unit,
                ..MveCovariance::default()
            }),
            score: method.uses_covariances().then_some(score),
            without_pairs,
        };
        SequentialEstimator::new(stage, method.build(fuser), sequential, init)
    }
}

/// Returns the calibration of a preset by its name; other pipelines use that of `hybrid`.
fn calibration(pipeline: &str) -> Calibration {
    Calibration::of(pipeline.parse().unwrap_or(Preset::Hybrid))
}
