//! Operations on 6×6 covariances: transport, inverse and determinant.

use hicp_core::internal::small::{cholesky6, eigen6};
use hicp_core::{Matrix6, Vector6};
use nalgebra::{Cholesky, U6};

/// Standard deviation, in meters and radians, for directions in which a singular covariance has
/// none.
// Open: smallest deviation of an estimate: §V. Meters and radians. It keeps singular covariances
// invertible.
pub const MIN_STANDARD_DEVIATION: f64 = 1e-6;

/// Share of its diagonal entry below which a pivot of the Cholesky decomposition is rounding.
const RELATIVE_PIVOT: f64 = 1e-13;

/// Returns (Σ + Σᵀ)/2.
pub(crate) fn symmetrized(matrix: &Matrix6<f64>) -> Matrix6<f64> {
    (matrix + matrix.transpose()) * 0.5
}

/// Returns Ad Σ Adᵀ: the same uncertainty in the frame that the adjoint maps to.
pub(crate) fn transported(covariance: &Matrix6<f64>, adjoint: &Matrix6<f64>) -> Matrix6<f64> {
    symmetrized(&(adjoint * covariance * adjoint.transpose()))
}

/// Returns Σ⁻¹.
///
/// If Σ is singular to working precision, its eigenvalues are first raised to
/// [`MIN_STANDARD_DEVIATION`]².
pub(crate) fn information(covariance: &Matrix6<f64>) -> Matrix6<f64> {
    if let Some(factor) = regular_factor(covariance) {
        return symmetrized(&factor.inverse());
    }
    let (eigenvalues, vectors) = floored_eigen(covariance);
    let inverse = Matrix6::from_diagonal(&eigenvalues.map(|value| 1.0 / value));
    symmetrized(&(vectors * inverse * vectors.transpose()))
}

/// Returns ln det Σ, with the eigenvalues of a singular Σ raised as in [`information`].
///
/// Motions do not change it, since det Ad = 1.
pub(crate) fn log_determinant(covariance: &Matrix6<f64>) -> f64 {
    if let Some(factor) = regular_factor(covariance) {
        let l = factor.l_dirty();
        return (0..6).map(|i| 2.0 * l[(i, i)].ln()).sum();
    }
    floored_eigen(covariance).0.iter().map(|v| v.ln()).sum()
}

/// Returns the Cholesky decomposition of a covariance that is regular to working precision.
fn regular_factor(covariance: &Matrix6<f64>) -> Option<Cholesky<f64, U6>> {
    let factor = cholesky6(covariance)?;
    let l = factor.l_dirty();
    let regular = (0..6).all(|i| {
        let pivot = l[(i, i)] * l[(i, i)];
        pivot > RELATIVE_PIVOT * covariance[(i, i)] && pivot > 1e-20
    });
    regular.then_some(factor)
}

/// Returns the eigenvalues, raised to [`MIN_STANDARD_DEVIATION`]², and the eigenvectors.
fn floored_eigen(covariance: &Matrix6<f64>) -> (Vector6<f64>, Matrix6<f64>) {
    let least = MIN_STANDARD_DEVIATION * MIN_STANDARD_DEVIATION;
    match eigen6(covariance) {
        Some(eigen) => (eigen.eigenvalues.map(|v| v.max(least)), eigen.eigenvectors),
        None => (
            covariance.diagonal().map(|v| v.max(least)),
            Matrix6::identity(),
        ),
    }
}
