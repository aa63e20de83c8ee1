//! The result of a stage, and the reason why it ended.

use hicp_core::{Correspondences, Isometry3, Iteration, Matrix6};
use hicp_metric::{Minimize, NormalEquations, Observability};

/// The reason why a stage ended.
///
/// Ending is not an error: for all data, a stage returns a pose and a reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Termination {
    /// The loss stopped changing.
    Converged,
    /// The iteration limit was reached. The last evaluated pose is returned.
    IterationLimit,
    /// No pairs were found, or all were filtered out (divergence rule 1, §IV-B).
    NoPairs,
    /// The pairs decreased by more than the limit since the first or the previous iteration
    /// (divergence rule 2).
    PairsLost,
    /// The mean loss rose (divergence rule 3).
    LossIncreased,
    /// The pairs did not determine a step.
    Degenerate,
    /// The pose returned to that of some iterations before, and would continue to do so.
    Oscillating,
    /// The pose left the bounds around the initial one.
    OutOfBounds,
    /// The time limit was reached. The last evaluated pose is returned.
    Deadline,
    /// The observer requested the stop. The last accepted pose is returned.
    Stopped,
    /// No stage ran, because a cascade is empty or a pose was only scored (`Refiner::judge`).
    Kept,
    /// A guard's score did not improve.
    ScoreNotImproved,
    /// The named part cannot work on the two sides of the problem.
    ///
    /// It needs a mesh or a depth image, and there is a point cloud instead.
    Unsupported(&'static str),
    /// A custom stop rule ended the stage for a custom reason, named as in traces and files
    /// (`snake_case`).
    Custom(&'static str),
}

impl Termination {
    /// All reasons that the library defines, except for those with a name inside.
    pub const ALL: [Self; 12] = [
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
        Self::Kept,
        Self::ScoreNotImproved,
    ];

    /// Returns the name in traces and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.texts().0
    }

    /// Returns the reason as a clause of a sentence.
    #[must_use]
    pub fn explain(self) -> &'static str {
        self.texts().1
    }

    fn texts(self) -> (&'static str, &'static str) {
        match self {
            Self::Converged => ("converged", "the loss stopped changing"),
            Self::IterationLimit => ("iteration_limit", "the limit of iterations was reached"),
            Self::NoPairs => (
                "no_pairs",
                "no pairs of model and observed points were found",
            ),
            Self::PairsLost => ("pairs_lost", "the next step lost too many pairs"),
            Self::LossIncreased => ("loss_increased", "the next step raised the loss"),
            Self::Degenerate => ("degenerate", "the pairs did not determine a step"),
            Self::Oscillating => ("oscillating", "the pose kept returning to earlier poses"),
            Self::OutOfBounds => (
                "out_of_bounds",
                "the pose left the bounds around the initial one",
            ),
            Self::Deadline => ("deadline", "the time limit was reached"),
            Self::Stopped => ("stopped", "the observer requested the stop"),
            Self::Kept => ("kept", "no stage ran"),
            Self::ScoreNotImproved => ("score_not_improved", "the score did not improve"),
            Self::Unsupported(_) => (
                "unsupported",
                "a part of the pipeline needs a mesh or a depth image instead of a point cloud",
            ),
            Self::Custom(name) => (name, name),
        }
    }

    /// Returns the part that ended a stage with [`Termination::Unsupported`].
    #[must_use]
    pub fn unsupported_part(self) -> Option<&'static str> {
        match self {
            Self::Unsupported(part) => Some(part),
            _ => None,
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

/// The result of evaluating the pairs of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Evaluation {
    /// Number of pairs after filtering.
    pub n_pairs: usize,
    /// Weighted mean of the metric's squared residuals, m². Comparable only within one metric.
    pub mean_loss: f64,
}

/// The fit of the pairs at the returned pose.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Quality {
    /// Matched share of the candidate points after filtering, 0 to 1; higher is better.
    pub fitness: f64,
    /// Root mean square of the distances between the points of the pairs, meters.
    pub point_rmse: f64,
    /// Root mean square of the distances of the model points to the observed tangent planes,
    /// meters. Observed points without a normal do not count.
    pub plane_rmse: f64,
    /// The metric's normal equations at the pose: the information of the pairs about its six
    /// directions.
    ///
    /// `None` if the metric has none.
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
    /// Measures the pairs of an iteration with a metric, or returns `None` without pairs.
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
        let (mut points, mut planes, mut without_normal) = (0.0, 0.0, 0.0);
        for pair in pairs.as_slice() {
            let difference = (pair.source.point - pair.target.point).cast::<f64>();
            points += difference.norm_squared();
            let plane = pair.target.normal.cast::<f64>().dot(&difference).powi(2);
            if plane.is_nan() {
                without_normal += 1.0;
            } else {
                planes += plane;
            }
        }
        Some(Self {
            // Several pairs per point must not give a share above 1.
            fitness: (count / pairs.n_candidates().max(1) as f64).min(1.0),
            point_rmse: (points / count).sqrt(),
            plane_rmse: (planes / f64::max(count - without_normal, 1.0)).sqrt(),
            system: metric.system(iteration, pairs),
        })
    }

    /// Returns the 6×6 information of the pose; see [`NormalEquations::information`].
    ///
    /// It belongs to ξ = [ρ; φ] (translation first, meters and radians), a left perturbation in the
    /// camera frame.
    #[must_use]
    pub fn information(&self) -> Option<Matrix6<f64>> {
        self.system.as_ref().map(NormalEquations::information)
    }

    /// Returns the 6×6 covariance of the pose, in the same convention.
    ///
    /// It is valid if the pairs are right and their residuals independent; see
    /// [`NormalEquations::covariance`]. If a direction is not determined, or the metric's policy
    /// freezes it, returns `None`.
    #[must_use]
    pub fn covariance(&self) -> Option<Matrix6<f64>> {
        self.system.as_ref().and_then(NormalEquations::covariance)
    }

    /// Returns how well each direction is determined; see [`NormalEquations::observability`].
    #[must_use]
    pub fn observability(&self) -> Option<Observability> {
        self.system
            .as_ref()
            .and_then(NormalEquations::observability)
    }
}

/// The change of the pose by a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Verdict {
    /// The returned pose is new.
    Refined,
    /// The returned pose is the initial one, bit for bit, for this reason.
    KeptInitial(Termination),
}

impl Verdict {
    /// Returns the name in reports and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Refined => "refined",
            Self::KeptInitial(_) => "kept_initial",
        }
    }
}

/// The result of a stage: a pose, the reason why the stage ended, and the quality of the pose.
///
/// The pose was either evaluated (its pairs were found, counted and measured) or is the initial
/// one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Outcome {
    /// The pose `camera_from_object`.
    pub camera_from_object: Isometry3<f64>,
    /// The reason why the stage ended.
    ///
    /// For a composed stage, it is that of the last stage that did not end as
    /// [`Termination::Kept`].
    pub termination: Termination,
    /// New pose, or initial pose with the reason.
    pub verdict: Verdict,
    /// Number of evaluations (associate, filter, minimize), including rejected ones.
    ///
    /// For a composed stage it is the sum over its parts.
    pub iterations: usize,
    /// Pairs and loss at the returned pose, from the last part that evaluated it; `None` if none
    /// did.
    ///
    /// If none did, the outcome of a `hybrid_icp::Refinement` has those of the refiner's own fit.
    pub evaluation: Option<Evaluation>,
    /// Fit of the pairs at the returned pose, from the same part; `None` if none evaluated it.
    pub quality: Option<Quality>,
}

impl Outcome {
    /// Returns the number of pairs at the returned pose, or 0 if it was never evaluated.
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

    /// Creates the outcome of a stage that keeps its initial pose without an evaluation.
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

    /// Returns the outcome with another reason why the stage ended.
    #[must_use]
    pub fn ended_by(self, termination: Termination) -> Self {
        Self {
            termination,
            verdict: match self.verdict {
                Verdict::Refined => Verdict::Refined,
                Verdict::KeptInitial(_) => Verdict::KeptInitial(termination),
            },
            ..self
        }
    }

    /// Returns the outcome of this stage followed by another one that started from its pose.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        // A part without an evaluation ends at the pose that the part before it measured.
        let measured = if next.evaluation.is_some() || next.verdict == Verdict::Refined {
            &next
        } else {
            &self
        };
        let moved = self.verdict == Verdict::Refined || next.verdict == Verdict::Refined;
        let termination = if next.termination == Termination::Kept {
            self.termination
        } else {
            next.termination
        };
        Self {
            camera_from_object: next.camera_from_object,
            termination,
            verdict: if moved {
                Verdict::Refined
            } else {
                Verdict::KeptInitial(termination)
            },
            iterations: self.iterations + next.iterations,
            evaluation: measured.evaluation,
            quality: measured.quality,
        }
    }
}
