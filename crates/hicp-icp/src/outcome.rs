//! How a stage ended, and what it returns.

use hicp_core::{Correspondences, Isometry3, Iteration, Matrix6};
use hicp_metric::{Minimize, NormalEquations, Observability};

/// Why a stage ended. Ending is not an error: whatever the data, a stage returns a pose and says why it stopped there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Termination {
    /// The loss stopped changing.
    Converged,
    /// The iteration limit was reached; the last evaluated pose is returned.
    IterationLimit,
    /// No pair was found, or every pair was filtered out (divergence rule 1, §IV-B).
    NoPairs,
    /// Fewer pairs than at the first or the previous iteration by more than the limit (divergence rule 2).
    PairsLost,
    /// The mean loss rose (divergence rule 3).
    LossIncreased,
    /// The pairs did not determine a step.
    Degenerate,
    /// The pose returned to where it had been some iterations before, and would go on doing so.
    Oscillating,
    /// The pose left the bounds set about the initial one.
    OutOfBounds,
    /// The time was up; the last evaluated pose is returned.
    Deadline,
    /// The observer asked to stop; the last evaluated pose is returned.
    Stopped,
    /// A guard's score did not improve.
    ScoreNotImproved,
    /// A custom stop rule ended the stage for a reason of its own, named as in traces and files (`snake_case`).
    Custom(&'static str),
}

impl Termination {
    /// Every way to end that the library knows: all but [`Termination::Custom`].
    pub const ALL: [Self; 11] = [
        Self::Converged,
        Self::IterationLimit,
        Self::NoPairs,
        Self::PairsLost,
        Self::LossIncreased,
        Self::Degenerate,
        Self::Oscillating,
        Self::OutOfBounds,
        Self::Deadline,
        Self::Stopped,
        Self::ScoreNotImproved,
    ];

    /// Name in traces and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::IterationLimit => "iteration_limit",
            Self::NoPairs => "no_pairs",
            Self::PairsLost => "pairs_lost",
            Self::LossIncreased => "loss_increased",
            Self::Degenerate => "degenerate",
            Self::Oscillating => "oscillating",
            Self::OutOfBounds => "out_of_bounds",
            Self::Deadline => "deadline",
            Self::Stopped => "stopped",
            Self::ScoreNotImproved => "score_not_improved",
            Self::Custom(name) => name,
        }
    }

    /// What it means for the pose that is returned, in words.
    #[must_use]
    pub fn explain(self) -> &'static str {
        match self {
            Self::Converged => "the loss stopped changing",
            Self::IterationLimit => "the limit of iterations was reached",
            Self::NoPairs => "no pairs of model and measured points were found",
            Self::PairsLost => "the next step lost too many pairs",
            Self::LossIncreased => "the next step raised the loss",
            Self::Degenerate => "the pairs did not determine a step",
            Self::Oscillating => {
                "the pose came back to where it had been, and would go on doing so"
            }
            Self::OutOfBounds => "the pose left the bounds set about the initial one",
            Self::Deadline => "the time was up",
            Self::Stopped => "the observer asked to stop",
            Self::ScoreNotImproved => "the score did not improve",
            Self::Custom(name) => name,
        }
    }
}

/// Serializes the name.
#[cfg(feature = "serde")]
impl serde::Serialize for Termination {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl std::fmt::Display for Termination {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// What was found when the pairs of a pose were evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Evaluation {
    /// Number of pairs after filtering.
    pub n_pairs: usize,
    /// Weighted mean of the metric's squared residuals, m². Comparable within one metric only.
    pub mean_loss: f64,
}

/// How well the pairs of the returned pose fit: what is measured there and nowhere else.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Quality {
    /// Share of the points that asked for a pair and have one after filtering, 0 to 1; higher is better.
    pub fitness: f64,
    /// Root mean square of the distances between the points of the pairs, metres.
    pub point_rmse: f64,
    /// Root mean square of the distances of the model points from the observed tangent planes, metres.
    pub plane_rmse: f64,
    /// The metric's normal equations there: what the pairs say about each of the six directions. `None` where it has none.
    #[cfg_attr(
        feature = "serde",
        serde(rename = "information", serialize_with = "serialize_information")
    )]
    pub system: Option<NormalEquations>,
}

/// Serializes normal equations as the 6×6 information of the pose.
#[cfg(feature = "serde")]
#[allow(clippy::ref_option)] // The signature that serde requires.
fn serialize_information<S: serde::Serializer>(
    system: &Option<NormalEquations>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serde::Serialize::serialize(
        &system.as_ref().map(NormalEquations::information),
        serializer,
    )
}

impl Quality {
    /// Measures the pairs of an iteration by a metric; `None` without any.
    #[must_use]
    #[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
    pub fn of<M: Minimize + ?Sized>(
        iteration: &Iteration<'_>,
        pairs: &Correspondences,
        metric: &mut M,
    ) -> Option<Self> {
        if pairs.is_empty() {
            return None;
        }
        let count = pairs.len() as f64;
        let (mut points, mut planes) = (0.0, 0.0);
        for pair in pairs.as_slice() {
            let difference = (pair.source.point - pair.target.point).cast::<f64>();
            points += difference.norm_squared();
            planes += pair.target.normal.cast::<f64>().dot(&difference).powi(2);
        }
        Some(Self {
            // Several pairs per point do not make more than all of the points matched.
            fitness: (count / pairs.n_candidates().max(1) as f64).min(1.0),
            point_rmse: (points / count).sqrt(),
            plane_rmse: (planes / count).sqrt(),
            system: metric.system(iteration, pairs),
        })
    }

    /// The 6×6 information of the pose, ξ = [ρ; φ] (translation first, metres and radians), a left perturbation in the camera
    /// frame; see [`NormalEquations::information`].
    #[must_use]
    pub fn information(&self) -> Option<Matrix6<f64>> {
        self.system.as_ref().map(NormalEquations::information)
    }

    /// The 6×6 covariance of the pose in the same convention, if the pairs are right and their residuals independent; see
    /// [`NormalEquations::covariance`]. `None` where a direction is not determined.
    #[must_use]
    pub fn covariance(&self) -> Option<Matrix6<f64>> {
        self.system.as_ref().and_then(NormalEquations::covariance)
    }

    /// How well each direction is determined; see [`NormalEquations::observability`].
    #[must_use]
    pub fn observability(&self) -> Option<Observability> {
        self.system
            .as_ref()
            .and_then(NormalEquations::observability)
    }
}

/// Whether a stage moved the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Verdict {
    /// The returned pose is a new one.
    Refined,
    /// The returned pose is the initial one, bit for bit, and this is why.
    KeptInitial(Termination),
}

/// What a stage returns: a pose, and an honest account of it.
///
/// The pose was either evaluated (its pairs were found, counted and measured) or is the initial one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Outcome {
    /// The pose.
    pub camera_from_object: Isometry3<f64>,
    /// Why the stage ended; for a composed stage, why its last part did.
    pub termination: Termination,
    /// Whether the pose is a new one.
    pub verdict: Verdict,
    /// Number of evaluations (associate, filter, minimise), rejected ones included; summed over the parts of a composed stage.
    pub iterations: usize,
    /// Pairs and loss at the returned pose, by the last part that evaluated it; `None` if none did.
    pub evaluation: Option<Evaluation>,
    /// How well the pairs at the returned pose fit, by the same part; `None` if none evaluated it.
    pub quality: Option<Quality>,
}

impl Outcome {
    /// Returns the number of pairs at the returned pose, 0 if it was never evaluated.
    #[must_use]
    pub fn n_pairs(&self) -> usize {
        self.evaluation.map_or(0, |e| e.n_pairs)
    }

    /// Creates the outcome of a stage that moved the pose, without iterations or an evaluation.
    #[must_use]
    pub fn refined(camera_from_object: Isometry3<f64>, termination: Termination) -> Self {
        Self {
            verdict: Verdict::Refined,
            ..Self::kept(&camera_from_object, termination)
        }
    }

    /// Creates the outcome of a stage that keeps the initial pose.
    #[must_use]
    pub fn kept(init: &Isometry3<f64>, termination: Termination) -> Self {
        Self {
            camera_from_object: *init,
            termination,
            verdict: Verdict::KeptInitial(termination),
            iterations: 0,
            evaluation: None,
            quality: None,
        }
    }

    /// Returns the outcome of this stage followed by another that started from its pose.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        // A part that evaluated nothing stands at the pose where the one before it was measured.
        let measured = if next.evaluation.is_some() || next.verdict == Verdict::Refined {
            &next
        } else {
            &self
        };
        let moved = self.verdict == Verdict::Refined || next.verdict == Verdict::Refined;
        Self {
            camera_from_object: next.camera_from_object,
            termination: next.termination,
            verdict: if moved {
                Verdict::Refined
            } else {
                Verdict::KeptInitial(next.termination)
            },
            iterations: self.iterations + next.iterations,
            evaluation: measured.evaluation,
            quality: measured.quality,
        }
    }
}
