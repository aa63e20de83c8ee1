//! Rotations and poses from rounded matrices.

use thiserror::Error;

use crate::internal::number::Number;
use crate::internal::small::inverse3;

use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, Translation3, UnitQuaternion};

/// Largest deviation from orthogonality and from determinant 1 that counts as rounding: entries
/// with three digits after the point deviate by at most 1.8·10⁻³.
const ROTATION_TOLERANCE: f64 = 2e-3;

/// Returns the rotation nearest to a matrix that is a rotation up to rounding.
///
/// Matrices read from files have three to nine digits and are orthogonal only to that precision.
/// The nearest rotation is the polar factor R (RᵀR)^−½. It is computed by Newton's iteration
/// R ← (R + R⁻ᵀ)/2, because nalgebra's `from_matrix` can return the identity near half turns.
///
/// # Errors
///
/// [`RotationError`] if an entry is not finite, or if the matrix deviates by more than 0.002 from
/// orthogonality or from determinant 1.
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
        // Within the tolerance, the matrix is far from singular and the iteration converges
        // quadratically.
        if let Some(inverse) = inverse3(&rotation) {
            rotation = (rotation + inverse.transpose()) * 0.5;
        }
    }
    Ok(UnitQuaternion::from_rotation_matrix(
        &Rotation3::from_matrix_unchecked(rotation),
    ))
}

/// Returns the pose of a 4×4 matrix [R t; 0 0 0 1], with t in meters.
///
/// R must be a rotation up to rounding.
///
/// # Errors
///
/// [`PoseMatrixError`] if R is not a rotation (see [`rotation_from_matrix`]), t is not finite, or
/// the last row is not [0 0 0 1].
///
/// ```
/// use hicp_core::{Matrix4, pose_from_matrix};
/// let matrix = Matrix4::new_translation(&hicp_core::Vector3::new(0.0, 0.1, 0.8));
/// assert_eq!(pose_from_matrix(&matrix).unwrap().translation.z, 0.8);
/// assert!(pose_from_matrix(&(matrix * 2.0)).is_err());
/// ```
pub fn pose_from_matrix(matrix: &Matrix4<f64>) -> Result<Isometry3<f64>, PoseMatrixError> {
    for (column, expected) in [0.0, 0.0, 0.0, 1.0].into_iter().enumerate() {
        let found = matrix[(3, column)];
        if found != expected {
            return Err(PoseMatrixError::LastRow {
                column,
                found,
                expected,
            });
        }
    }
    let rotation = rotation_from_matrix(&matrix.fixed_view::<3, 3>(0, 0).into_owned())?;
    for row in 0..3 {
        let found = matrix[(row, 3)];
        if !found.is_finite() {
            return Err(PoseMatrixError::Translation { row, found });
        }
    }
    let translation = Translation3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]);
    Ok(Isometry3::from_parts(translation, rotation))
}

/// The reason why a 4×4 matrix is not a pose.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum PoseMatrixError {
    /// The upper left 3×3 block is not a rotation.
    #[error(transparent)]
    Rotation(#[from] RotationError),
    /// A component of the translation is not finite.
    #[error("translation entry [{row}][3] is {found}, expected a finite number of meters")]
    Translation {
        /// Row, from 0.
        row: usize,
        /// The value given.
        found: f64,
    },
    /// The last row is not [0 0 0 1]; the matrix may be transposed.
    #[error(
        "pose matrix entry [3][{column}] is {found}, expected {expected}: the last row must be [0 0 0 1], is the matrix transposed?"
    )]
    LastRow {
        /// Column, from 0.
        column: usize,
        /// The value given.
        found: f64,
        /// The value required.
        expected: f64,
    },
}

/// The reason why a 3×3 matrix is not a rotation.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum RotationError {
    /// An entry is not finite.
    #[error("rotation entry [{row}][{column}] is {value}, expected a finite number")]
    NotFinite {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
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
        /// The largest accepted deviation.
        tolerance: f64,
    },
    /// The determinant is not +1. A determinant of −1 means a reflection.
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
