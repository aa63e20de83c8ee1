//! One step of a sequential estimator.

use hicp_core::{Isometry3, Matrix6};
use hicp_fusion::{CovarianceModel, FusionError, Update};
use hicp_icp::{Outcome, Termination};
use hicp_score::MeanVsd;

/// The covariance and the score of the estimates of a
/// [`SequentialEstimator`](crate::SequentialEstimator).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SequentialConfig {
    /// Source of the covariance of an estimate. For a custom one, see
    /// [`SequentialEstimator::with_covariance`](crate::SequentialEstimator::with_covariance).
    pub covariance: CovarianceModel,
    /// The score of each estimate against its image.
    ///
    /// If neither the fuser nor the covariance needs an MVE, `None` saves a render. For a custom
    /// score, see [`SequentialEstimator::with_score`](crate::SequentialEstimator::with_score).
    pub score: Option<MeanVsd>,
    /// The pose that is fused if ICP finds no pairs.
    pub without_pairs: WithoutPairs,
}

/// The pose that is fused for an image in which ICP finds no pairs.
// Deviation: no pairs: §IV-B.2 returns the initial pose, which §V then fuses as an estimate.
// Here nothing is fused, because the image added nothing. `SequentialEstimator::paper` fuses the
// initial pose (`WithoutPairs::Initial`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum WithoutPairs {
    /// Nothing: the fused pose stays.
    #[default]
    Nothing,
    /// The initial pose of ICP, as if it were an estimate (§IV-B).
    Initial,
}

impl Default for SequentialConfig {
    /// e_MVE·I₆ with the MVE that recognizes occlusion.
    fn default() -> Self {
        Self {
            covariance: CovarianceModel::default(),
            score: Some(MeanVsd::default()),
            without_pairs: WithoutPairs::Nothing,
        }
    }
}

/// The effect of one image.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum SequentialEvent {
    /// There was an estimate, and the fuser returned this.
    Estimated(Update),
    /// ICP found no pose and kept its initial one, for instance because nothing was seen. The fused
    /// pose stays.
    ///
    /// A pose that is kept because no other one has a better score is an estimate.
    NoEstimate(Termination),
    /// The estimate or its covariance was refused. The fused pose stays.
    Refused(FusionError),
}

impl SequentialEvent {
    /// Returns the reason why the estimate was not accepted, or `None` if it was.
    #[must_use]
    pub fn reason(&self) -> Option<String> {
        match self {
            Self::Estimated(update) => update.failure().map(ToString::to_string),
            Self::NoEstimate(termination) => Some(termination.explain().to_owned()),
            Self::Refused(error) => Some(error.to_string()),
        }
    }
}

/// Counts the images that agree with the stated motion of the camera, and those that contradict it.
///
/// Nothing else checks the motion. Call [`MotionCheck::add`] after each step of a
/// [`SequentialEstimator`](crate::SequentialEstimator). If [`MotionCheck::contradicting`] returns a
/// number, the motions are probably wrong, for example inverted or in another unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotionCheck {
    accepted: usize,
    contradicting: usize,
}

impl MotionCheck {
    /// Counts an image by the event of its step.
    pub fn add(&mut self, event: &SequentialEvent) {
        match event {
            SequentialEvent::Estimated(Update::Accepted(_)) => self.accepted += 1,
            SequentialEvent::Estimated(Update::Rejected(_) | Update::Restarted(..)) => self.miss(),
            _ => {}
        }
    }

    /// Counts an image that shows the object, but not at the pose that moved with the camera.
    ///
    /// It counts only after an accepted image: before, the initial pose may be wrong.
    pub fn miss(&mut self) {
        self.contradicting += usize::from(self.accepted > 0);
    }

    /// Returns the number of accepted images.
    #[must_use]
    pub fn accepted(&self) -> usize {
        self.accepted
    }

    /// Returns the number of contradicting images if they are as many as the accepted ones.
    #[must_use]
    pub fn contradicting(&self) -> Option<usize> {
        let contradicting = Some(self.contradicting);
        contradicting.filter(|count| self.accepted > 0 && *count >= self.accepted)
    }
}

/// The object's pose after one image, and how it was found.
///
/// Poses and covariances are in the camera frame of that image.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct SequentialStep {
    /// The fused pose; while there is no estimate, the initial one, moved with the camera.
    pub camera_from_object: Isometry3<f64>,
    /// Its covariance (ξ = [ρ; φ], left perturbation, meters and radians); `None` while there is no
    /// estimate.
    pub covariance: Option<Matrix6<f64>>,
    /// The initial pose of ICP: the pose fused before, moved with the camera.
    pub init: Isometry3<f64>,
    /// The outcome of ICP for this image alone.
    pub outcome: Outcome,
    /// The mean VSD estimate of `outcome`; `None` if it was not scored.
    pub mve: Option<f64>,
    /// The effect on the fused pose.
    pub event: SequentialEvent,
}
