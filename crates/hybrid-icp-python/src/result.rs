//! `Result`.

use hybrid_icp::icp::{Quality, Verdict};
use hybrid_icp::{Refinement, StageRecord};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{self, Matrix, Motion};
use crate::events::{self, PyStageEvent};

/// What a refinement returns: a pose, how it came about, and how well it explains the image.
///
/// A pose that could not be refined is given back with the numbers that were passed, and `outcome`
/// says so; that is no error.
#[pyclass(frozen, module = "hybrid_icp", name = "Result")]
#[derive(Debug)]
pub(crate) struct PyResultOf {
    refinement: Refinement,
    matrix: [f64; 16],
    stages: Vec<StageRecord>,
}

impl PyResultOf {
    pub(crate) fn new(init: &Motion, refinement: Refinement, stages: Vec<StageRecord>) -> Self {
        let outcome = &refinement.outcome;
        let matrix = match outcome.verdict {
            Verdict::Refined => array::to_matrix(&outcome.camera_from_object),
            // The very numbers that were given, though they be orthogonal only to their digits.
            Verdict::KeptInitial(_) => init.matrix,
        };
        Self {
            refinement,
            matrix,
            stages,
        }
    }

    fn quality(&self) -> Option<&Quality> {
        self.refinement.outcome.quality.as_ref()
    }
}

#[pymethods]
#[allow(non_snake_case)] // T_co is the frame-explicit name of the pose, the same on both sides.
impl PyResultOf {
    /// The pose, camera from object, shape (4, 4), float64, metres.
    #[getter]
    fn T_co(&self) -> Matrix {
        Matrix::new(4, self.matrix.to_vec())
    }

    /// Mean VSD estimate of the returned pose: 0 where it explains the image everywhere, 1 nowhere.
    /// Above 0.4, do not use the pose.
    #[getter]
    fn mve(&self) -> f64 {
        self.refinement.mve
    }

    /// Mean VSD estimate of the initial pose.
    #[getter]
    fn mve_initial(&self) -> f64 {
        self.refinement.mve_initial
    }

    /// Why the pose is not to be trusted, in words: it does not explain the image, got worse, was
    /// found where the initial pose explained nothing, or lies on a surface that is flat where the
    /// model is not. Empty where the scores say nothing against it.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        let warnings = self.refinement.warnings();
        warnings.iter().map(ToString::to_string).collect()
    }

    /// "refined", or "kept_initial" when the initial pose is returned.
    #[getter]
    fn outcome(&self) -> &'static str {
        events::name(self.refinement.outcome.verdict)
    }

    /// Whether the returned pose is a new one.
    #[getter]
    fn refined(&self) -> bool {
        self.refinement.outcome.verdict == Verdict::Refined
    }

    /// Why the pipeline ended, such as "converged", "iteration_limit", "loss_increased" or
    /// "no_pairs".
    #[getter]
    fn termination(&self) -> &'static str {
        self.refinement.outcome.termination.name()
    }

    /// Number of evaluations, rejected ones included, over all stages.
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

    /// Share of the points that have a pair, 0 to 1; None if the pose was never evaluated.
    #[getter]
    fn fitness(&self) -> Option<f64> {
        self.quality().map(|quality| quality.fitness)
    }

    /// Root mean square of the distances between the points of the pairs, metres; None if the pose
    /// was never evaluated.
    #[getter]
    fn point_rmse(&self) -> Option<f64> {
        self.quality().map(|quality| quality.point_rmse)
    }

    /// Root mean square of the distances from the observed tangent planes, metres; None if the pose
    /// was never evaluated.
    #[getter]
    fn plane_rmse(&self) -> Option<f64> {
        self.quality().map(|quality| quality.plane_rmse)
    }

    /// Information of the pose, shape (6, 6), float64; None where the metric has none.
    ///
    /// For ξ = [ρ; φ], translation first (metres, radians), a left perturbation in the camera
    /// frame.
    #[getter]
    fn information(&self) -> Option<Matrix> {
        let information = self.quality().and_then(Quality::information);
        information.as_ref().map(Matrix::from)
    }

    /// Covariance of the pose in the same convention, shape (6, 6), float64, if pairs are right and
    /// residuals independent; None where a direction is not determined.
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

    /// Returns everything as plain Python values that `json.dumps` takes.
    ///
    /// Returns
    /// -------
    /// dict
    ///     The attributes by name; matrices as nested lists.
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let names = [
            "T_co",
            "mve",
            "mve_initial",
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
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        format!(
            "Result({}, mve {:.3} -> {:.3}, {} pairs, {} iterations, {})",
            self.outcome(),
            self.mve_initial(),
            self.mve(),
            self.n_pairs(),
            self.iterations(),
            self.termination()
        )
    }
}
