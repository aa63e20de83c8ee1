//! Computes single steps of the error metrics.

use hybrid_icp::core::{
    Correspondences, Isometry3, Iteration, Pair, Point3, Surfel, UnitVector3, Vector3,
};
use hybrid_icp::metric::{Minimize, PointToPlane, PointToPoint};
use pyo3::prelude::*;

use crate::array::{self, Matrix};
use crate::errors::InputError;

/// Computes one step of point-to-point ICP on given pairs.
///
/// The step is the rigid motion that minimizes Σ|T pᵢ − cᵢ|² (Kabsch).
/// Of the steps that fit pairs on a line equally well, it has the smallest rotation.
///
/// Parameters
/// ----------
/// sources : array_like, shape (N, 3)
///     Model points pᵢ in the camera frame, read as float32, meters.
/// targets : array_like, shape (N, 3)
///     The observed points cᵢ of the pairs, meters.
///
/// Returns
/// -------
/// increment : numpy.ndarray, shape (4, 4), float64
///     T, meters. It multiplies the pose from the left.
/// mean_loss : float
///     Mean of |pᵢ − cᵢ|² before the step, m².
///
/// Raises
/// ------
/// InputError
///     If there are fewer than three pairs, numbers that are not finite, or different numbers of
///     sources and targets.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from hybrid_icp import point_to_point_step
/// >>> corners = np.eye(3)
/// >>> increment, loss = point_to_point_step(corners, corners + [0, 0, 0.5])
/// >>> np.round(increment[:3, 3], 6) + 0.0
/// array([0. , 0. , 0.5])
#[pyfunction]
pub(crate) fn point_to_point_step(
    sources: &Bound<'_, PyAny>,
    targets: &Bound<'_, PyAny>,
) -> PyResult<(Matrix, f64)> {
    step(sources.py(), PointToPoint, &pairs(sources, targets, None)?)
}

/// Computes one step of point-to-plane ICP on given pairs.
///
/// The step is a Gauss–Newton step on Σ(nᵢ·(T pᵢ − cᵢ))².
/// Directions that the normals do not determine are damped, so they hardly move.
///
/// Parameters
/// ----------
/// sources : array_like, shape (N, 3)
///     Model points pᵢ in the camera frame, read as float32, meters.
/// targets : array_like, shape (N, 3)
///     The observed points cᵢ of the pairs, meters.
/// normals : array_like, shape (N, 3)
///     The observed normals nᵢ of the pairs. They are normalized to unit length.
///
/// Returns
/// -------
/// increment : numpy.ndarray, shape (4, 4), float64
///     T = exp(ξ^) of the linear least-squares solution ξ, meters. It multiplies the pose from the
///     left.
/// mean_loss : float
///     Mean of (nᵢ·(pᵢ − cᵢ))² before the step, m².
///
/// Raises
/// ------
/// InputError
///     If there are fewer than six pairs, numbers that are not finite, normals of length 0, or
///     different numbers of rows.
#[pyfunction]
pub(crate) fn point_to_plane_step(
    sources: &Bound<'_, PyAny>,
    targets: &Bound<'_, PyAny>,
    normals: &Bound<'_, PyAny>,
) -> PyResult<(Matrix, f64)> {
    let pairs = pairs(sources, targets, Some(normals))?;
    step(sources.py(), PointToPlane, &pairs)
}

fn step(
    py: Python<'_>,
    mut metric: impl Minimize + Send,
    pairs: &Correspondences,
) -> PyResult<(Matrix, f64)> {
    let step = py.detach(|| metric.minimize(&Iteration::default(), pairs));
    let step = step.ok_or_else(|| {
        let count = pairs.len();
        InputError::new_err(format!(
            "the {count} pairs do not determine a step, expected pairs that fix all six degrees of \
             freedom"
        ))
    })?;
    Ok(((&step.increment).into(), step.mean_loss))
}

fn pairs(
    sources: &Bound<'_, PyAny>,
    targets: &Bound<'_, PyAny>,
    normals: Option<&Bound<'_, PyAny>>,
) -> PyResult<Correspondences> {
    let points = array::points(sources, "sources")?;
    let target_points = array::points(targets, "targets")?;
    let normals = match normals {
        Some(normals) => unit_normals(normals)?,
        // Point-to-point does not use them.
        None => vec![-Vector3::z_axis(); points.len()],
    };
    for (name, count) in [("targets", target_points.len()), ("normals", normals.len())] {
        if count != points.len() {
            return Err(InputError::new_err(format!(
                "{name} has {count} rows but sources has {}, expected the same number",
                points.len()
            )));
        }
    }
    let mut pairs = Correspondences::new();
    pairs.begin(&Isometry3::identity(), points.len());
    let rows = points.into_iter().zip(target_points).zip(normals);
    for (index, ((source, target), normal)) in (0_u32..).zip(rows) {
        let surfel = |point: Point3<f32>| Surfel { point, normal };
        pairs.push(Pair::new(index, surfel(source), index, surfel(target)));
    }
    Ok(pairs)
}

fn unit_normals(normals: &Bound<'_, PyAny>) -> PyResult<Vec<UnitVector3<f32>>> {
    let vectors = array::points(normals, "normals")?;
    (0..)
        .zip(&vectors)
        .map(|(row, vector): (usize, _)| {
            UnitVector3::try_new(vector.coords, f32::MIN_POSITIVE).ok_or_else(|| {
                InputError::new_err(format!(
                    "normals[{row}] has no direction, expected a vector of nonzero length"
                ))
            })
        })
        .collect()
}
