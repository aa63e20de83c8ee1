//! Linear algebra of small matrices, compiled once.
//!
//! The functions of nalgebra are generic, so each crate that calls them compiles them again.

use nalgebra::{Cholesky, Matrix3, Matrix6, SymmetricEigen, U3, U6, Vector3, Vector6};

/// Iterations of an eigendecomposition. Entries that are not finite would never converge.
const EIGEN_ITERATIONS: usize = 1000;

/// Returns the inverse of a matrix, or `None` if it is singular.
#[must_use]
pub fn inverse3(matrix: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    matrix.try_inverse()
}

/// Returns the inverse of a matrix, or `None` if it is singular.
#[must_use]
pub fn inverse6(matrix: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    matrix.try_inverse()
}

/// Returns eigenvalues and eigenvectors of a symmetric matrix, or `None` if it does not converge.
#[must_use]
pub fn eigen3(matrix: &Matrix3<f64>) -> Option<SymmetricEigen<f64, U3>> {
    SymmetricEigen::try_new(*matrix, f64::EPSILON, EIGEN_ITERATIONS)
}

/// Returns eigenvalues and eigenvectors of a symmetric matrix, or `None` if it does not converge.
#[must_use]
pub fn eigen6(matrix: &Matrix6<f64>) -> Option<SymmetricEigen<f64, U6>> {
    SymmetricEigen::try_new(*matrix, f64::EPSILON, EIGEN_ITERATIONS)
}

/// Returns the Cholesky decomposition of a matrix, or `None` if it is not positive definite.
#[must_use]
pub fn cholesky6(matrix: &Matrix6<f64>) -> Option<Cholesky<f64, U6>> {
    matrix.cholesky()
}

/// Solves a system whose matrix was decomposed.
#[must_use]
pub fn solve6(factor: &Cholesky<f64, U6>, right: &Vector6<f64>) -> Vector6<f64> {
    factor.solve(right)
}

/// Returns the inverse of a matrix that was decomposed.
#[must_use]
pub fn inverse_of(factor: &Cholesky<f64, U6>) -> Matrix6<f64> {
    factor.inverse()
}

/// Returns the vector [ρ; φ].
#[must_use]
pub fn join(rho: &Vector3<f64>, phi: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
}

/// Returns the matrix [a b; 0 d].
#[must_use]
pub fn blocks(a: &Matrix3<f64>, b: &Matrix3<f64>, d: &Matrix3<f64>) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(a);
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(b);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(d);
    matrix
}
