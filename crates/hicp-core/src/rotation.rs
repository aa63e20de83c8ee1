//! Rotations from matrices that somebody wrote down.

use thiserror::Error;

use crate::number::Number;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

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

/// A 3×3 matrix that is not a rotation.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum RotationError {
    /// A component is not finite.
    #[error("rotation entry [{row}][{column}] is {value}, expected a finite number")]
    NotFinite {
        /// Row from 0.
        row: usize,
        /// Column from 0.
        column: usize,
        /// The value given.
        value: f64,
    },
    /// R Rᵀ is not the identity.
    #[error(
        "rotation is not orthogonal: the largest entry of |R Rᵀ - I| is {}, expected at most {tolerance}",
        Number(*deviation)
    )]
    NotOrthogonal {
        /// max |R Rᵀ − I|.
        deviation: f64,
        /// The largest deviation accepted.
        tolerance: f64,
    },
    /// The determinant is not +1: a reflection when it is −1.
    #[error(
        "rotation has determinant {}, expected 1 within {tolerance} (-1 is a reflection)",
        Number(*determinant)
    )]
    Determinant {
        /// det R.
        determinant: f64,
        /// The largest deviation accepted.
        tolerance: f64,
    },
}
