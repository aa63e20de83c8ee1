//! `Result`.

use std::collections::BTreeMap;

use hybrid_icp::icp::{Alternative, Quality, Verdict};
use hybrid_icp::{Refinement, StageRecord};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{self, Matrix, Motion};
use crate::events::{self, PyStageEvent};

/// The result of a refinement: a pose, its score, and the stages that ran.
///
/// If the pose could not be refined, `T_co` has the numbers that were passed, and `outcome` is
/// "kept_initial". This is not an error.
#[pyclass(frozen, module = "hybrid_icp", name = "Result")]
#[derive(Debug)]
pub(crate) struct PyResultOf {
    refinement: Refinement,
    matrix: [f64; 16],
    stages: Vec<StageRecord>,
    alternatives: Vec<Alternative>,
}

impl PyResultOf {
    pub(crate) fn new(
        init: &Motion,
        refinement: Refinement,
        stages: Vec<StageRecord>,
        alternatives: Vec<Alternative>,
    ) -> Self {
        let outcome = &refinement.outcome;
        let matrix = match outcome.verdict {
            Verdict::Refined => array::to_matrix(&outcome.camera_from_object),
            // The numbers that were passed, which can be orthogonal only to their precision.
            Verdict::KeptInitial(_) => init.matrix,
        };
        Self {
            refinement,
            matrix,
            stages,
            alternatives,
        }
    }

    fn quality(&self) -> Option<&Quality> {
        self.refinement.outcome.quality.as_ref()
    }
}

#[pymethods]
#[allow(non_snake_case)] // T_co names the frames of the pose, as in Python.
impl PyResultOf {
    /// The pose, camera from object, shape (4, 4), float64, meters.
    #[getter]
    fn T_co(&self) -> Matrix {
        Matrix::new(4, self.matrix.to_vec())
    }

    /// Probability that the pose is right, 0 to 1.
    ///
    /// A pose is right if no point of the surface is farther from its true place than a tenth of
    /// the diameter. Accept a pose with 0.95 or more.
    #[getter]
    fn confidence(&self) -> f64 {
        self.refinement.confidence
    }

    /// Largest distance to expect of a surface point from its true place, meters.
    #[getter]
    fn expected_error_meters(&self) -> f64 {
        self.refinement.expected_error_meters
    }

    /// Rotation error to expect, degrees.
    #[getter]
    fn expected_error_degrees(&self) -> f64 {
        self.refinement.expected_error_degrees
    }

    /// Mean VSD estimate of the returned pose: 0 if it explains the image everywhere, 1 if nowhere.
    ///
    /// Imperfect masks raise it for right poses, too; `confidence` does not have this weakness.
    #[getter]
    fn mve(&self) -> f64 {
        self.refinement.mve
    }

    /// Mean VSD estimate of the initial pose; equal to `mve` after `Pipeline.estimate`.
    #[getter]
    fn mve_initial(&self) -> f64 {
        self.refinement.mve_initial
    }

    /// Evidence for and against the returned pose, from one render; a dict of float by name.
    ///
    /// The shares of the rendered pixels add up to 1:
    ///
    /// - `agrees`: the measured surface is within 10 % of the diameter of the rendered one.
    /// - `seen_through`: it is farther; the camera looks through the object.
    /// - `inside`: it is nearer and continues an agreeing surface; the object is in a table or
    ///   wall.
    /// - `hidden`: it is nearer and ends in a step; something stands in front.
    /// - `unmeasured`: no depth was measured.
    ///
    /// The others are `pixels` (rendered), `unexplained` (share of the mask at which the model does
    /// not agree), `residual` and `noise` (medians, diameters), `contour` (share of the contour at
    /// which the measured surface ends; NaN if nothing was measured there), `mask_extra` and
    /// `mask_missing` (shares by which the mask is too large and too small) and
    /// `mask_growth_pixels` (negative if it is too small).
    #[getter]
    fn evidence(&self) -> BTreeMap<&'static str, f64> {
        BTreeMap::from(self.refinement.evidence.named())
    }

    /// Reasons not to trust the pose, as sentences; empty if there are none.
    ///
    /// - The pose does not explain the image, or is more likely wrong than right.
    /// - The refinement made the pose worse.
    /// - The initial pose explained nothing of the image.
    /// - The measured surface is flat, but the model is not.
    /// - Another pose explains the image as well.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        let warnings = self.refinement.warnings();
        warnings.iter().map(ToString::to_string).collect()
    }

    /// The distinct other poses that a search found, best first; a list of dicts, empty without a
    /// search.
    ///
    /// Poses are distinct if their MSSD, up to declared symmetries, is above a tenth of the
    /// diameter. The keys:
    ///
    /// - `T_co`: the pose, camera from object, shape (4, 4), float64, meters.
    /// - `score`: the score of the search; lower is better.
    /// - `gap`: the score minus that of the returned pose.
    /// - `mssd`: distance from the returned pose, meters.
    /// - `rotation_degrees`: angle to the returned pose.
    #[getter]
    fn alternatives<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let dict = |other: &Alternative| {
            let dict = PyDict::new(py);
            let pose = array::to_matrix(&other.camera_from_object);
            dict.set_item("T_co", Matrix::new(4, pose.to_vec()))?;
            dict.set_item("score", other.score)?;
            dict.set_item("gap", other.gap)?;
            dict.set_item("mssd", other.mssd_meters)?;
            dict.set_item("rotation_degrees", other.rotation_degrees)?;
            Ok(dict)
        };
        self.alternatives.iter().map(dict).collect()
    }

    /// "refined", or "kept_initial" if the result is the initial pose.
    #[getter]
    fn outcome(&self) -> &'static str {
        events::name(self.refinement.outcome.verdict)
    }

    /// Returns `True` if the pose was refined. If not, the pose is the initial one.
    #[getter]
    fn refined(&self) -> bool {
        self.refinement.outcome.verdict == Verdict::Refined
    }

    /// The reason why the pipeline ended, such as "converged", "iteration_limit",
    /// "loss_increased" or "no_pairs".
    #[getter]
    fn termination(&self) -> &'static str {
        self.refinement.outcome.termination.name()
    }

    /// Number of evaluations in all stages, including rejected ones.
    #[getter]
    fn iterations(&self) -> usize {
        self.refinement.outcome.iterations
    }

    /// Number of pairs at the returned pose; 0 if it was never evaluated.
    #[getter]
    fn n_pairs(&self) -> usize {
        self.refinement.outcome.n_pairs()
    }

    /// Weighted mean of the metric's squared residuals at the returned pose, m²; None if it was
    /// never evaluated.
    #[getter]
    fn mean_loss(&self) -> Option<f64> {
        self.refinement.outcome.evaluation.map(|e| e.mean_loss)
    }

    /// Share of the points with a pair, 0 to 1; None if the pose was never evaluated.
    #[getter]
    fn fitness(&self) -> Option<f64> {
        self.quality().map(|quality| quality.fitness)
    }

    /// Root mean square of the distances between the points of the pairs, meters; None if the pose
    /// was never evaluated.
    #[getter]
    fn point_rmse(&self) -> Option<f64> {
        self.quality().map(|quality| quality.point_rmse)
    }

    /// Root mean square of the distances from the observed tangent planes, meters; None if the pose
    /// was never evaluated.
    #[getter]
    fn plane_rmse(&self) -> Option<f64> {
        self.quality().map(|quality| quality.plane_rmse)
    }

    /// Information matrix of the pose, shape (6, 6), float64; None if the metric has none.
    ///
    /// It refers to ξ = [ρ; φ], a left perturbation in the camera frame, translation first (meters,
    /// radians).
    #[getter]
    fn information(&self) -> Option<Matrix> {
        let information = self.quality().and_then(Quality::information);
        information.as_ref().map(Matrix::from)
    }

    /// Covariance of the pose, shape (6, 6), float64; None if a direction is not determined.
    ///
    /// It has the convention of `information`. It holds if the pairs are right and the residuals
    /// are independent.
    #[getter]
    fn covariance(&self) -> Option<Matrix> {
        let covariance = self.quality().and_then(Quality::covariance);
        covariance.as_ref().map(Matrix::from)
    }

    /// The ICP stages that ran, in order.
    #[getter]
    fn stages(&self) -> Vec<PyStageEvent> {
        self.stages.iter().map(PyStageEvent::from).collect()
    }

    /// Returns all attributes as plain Python values that `json.dumps` accepts.
    ///
    /// Returns
    /// -------
    /// dict
    ///     The attributes by name; matrices as nested lists.
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let names = [
            "T_co",
            "confidence",
            "expected_error_meters",
            "expected_error_degrees",
            "mve",
            "mve_initial",
            "evidence",
            "warnings",
            "outcome",
            "termination",
            "iterations",
            "n_pairs",
            "mean_loss",
            "fitness",
            "point_rmse",
            "plane_rmse",
            "information",
            "covariance",
        ];
        let dict = events::plain(slf, &names)?;
        let stages = slf.getattr("stages")?.try_iter()?;
        let stages: PyResult<Vec<_>> = stages.map(|stage| stage?.call_method0("to_dict")).collect();
        dict.set_item("stages", stages?)?;
        let others = slf.get().alternatives(slf.py())?;
        for other in &others {
            if let Some(pose) = other.get_item("T_co")? {
                other.set_item("T_co", pose.call_method0("tolist")?)?;
            }
        }
        dict.set_item("alternatives", others)?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        format!(
            "Result({}, confidence {:.2}, mve {:.3} -> {:.3}, {} pairs, {} iterations, {})",
            self.outcome(),
            self.confidence(),
            self.mve_initial(),
            self.mve(),
            self.n_pairs(),
            self.iterations(),
            self.termination()
        )
    }
}
