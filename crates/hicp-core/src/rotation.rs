//! Rotations from matrices that somebody wrote down.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use crate::error::RotationError;

/// Largest deviation from orthogonality and from determinant 1 that is taken for rounding.
pub const ROTATION_TOLERANCE: f64 = 1e-3;

/// Returns the rotation nearest to a matrix that is one up to rounding.
///
/// Matrices read from files carry five to nine digits, so they are orthogonal only to that; the polar factor R (RᵀR)^−½
/// is the nearest rotation, found by Newton's iteration R ← (R + R⁻ᵀ)/2. (nalgebra's `from_matrix` can return the identity near half turns.)
///
/// # Errors
///
/// [`RotationError`] when an entry is not finite or the matrix is further than [`ROTATION_TOLERANCE`] from a rotation.
///
/// ```
/// use hicp_core::{Matrix3, RotationError, rotation_from_matrix};
/// let reflection = Matrix3::from_diagonal(&[1.0, 1.0, -1.0].into());
/// assert!(matches!(rotation_from_matrix(&reflection), Err(RotationError::Determinant { .. })));
/// ```
pub fn rotation_from_matrix(matrix: &Matrix3<f64>) -> Result<UnitQuaternion<f64>, RotationError> {
    for row in 0..3 {
        for column in 0..3 {
            let value = matrix[(row, column)];
            if !value.is_finite() {
                return Err(RotationError::NotFinite { row, column, value });
            }
        }
    }
    let tolerance = ROTATION_TOLERANCE;
    let deviation = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    if deviation > tolerance {
        return Err(RotationError::NotOrthogonal {
            deviation,
            tolerance,
        });
    }
    let determinant = matrix.determinant();
    if (determinant - 1.0).abs() > tolerance {
        return Err(RotationError::Determinant {
            determinant,
            tolerance,
        });
    }
    let mut rotation = *matrix;
    for _ in 0..4 {
        // Within the tolerance the matrix is far from singular, and the iteration converges quadratically.
        if let Some(inverse) = rotation.try_inverse() {
            rotation = (rotation + inverse.transpose()) * 0.5;
        }
    }
    Ok(UnitQuaternion::from_rotation_matrix(
        &Rotation3::from_matrix_unchecked(rotation),
    ))
}
