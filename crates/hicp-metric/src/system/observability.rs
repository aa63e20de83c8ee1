//! The motions that the pairs determine.

use hicp_core::{Isometry3, Point3, Translation3, Vector3, Vector6, se3};

use crate::system::normal_equations::NormalEquations;
use crate::system::solve::eigen;

/// The six motions that a set of pairs determines, from worst to best.
///
/// They are the eigendecomposition of the scaled JᵀWJ. Rotations are around the pivot and scaled by
/// the length (see [`NormalEquations`]), so all six directions are displacements of similar size.
/// The ratio of eigenvalues therefore does not depend on the unit, the distance, or the number of
/// pairs. Zhang, Kaess & Singh 2016 describe the analysis; raw eigenvalues would mix m² and rad².
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Observability {
    /// Eigenvalues relative to the largest, ascending, in [0, 1]; all zero without information.
    pub eigenvalues: [f64; 6],
    /// The directions [ρ; L φ] of the eigenvalues, camera frame, with rotations around the pivot.
    ///
    /// They are unit vectors, and all six components are lengths.
    pub directions: [Vector6<f64>; 6],
    /// Center of rotations, camera frame, meters.
    pub pivot: Point3<f64>,
    /// Length scale L, meters per radian.
    pub length: f64,
}

impl Observability {
    /// Returns the number of directions whose eigenvalue is at most `threshold` times the largest.
    ///
    /// They are the first ones of [`Observability::directions`].
    ///
    /// ```
    /// use hicp_core::{Point3, Vector3};
    /// use hicp_metric::{Degeneracy, NormalEquations};
    /// // A plane at half a meter, with its normal toward the camera.
    /// let mut plane = NormalEquations::new(Point3::new(0.0, 0.0, 0.5), 0.1);
    /// for (x, y) in [(0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.0, -0.1), (0.07, 0.07), (-0.07, -0.07)] {
    ///     plane.add_row(&Point3::new(x, y, 0.5), &-Vector3::z(), 0.0, 1.0);
    /// }
    /// // Two translations and the rotation around the normal are undetermined.
    /// assert_eq!(plane.observability().unwrap().n_degenerate(Degeneracy::THRESHOLD), 3);
    /// ```
    #[must_use]
    pub fn n_degenerate(&self, threshold: f64) -> usize {
        let determined = |value: &&f64| **value > threshold.max(0.0);
        6 - self.eigenvalues.iter().filter(determined).count()
    }

    /// Returns the motion of the camera frame along one of [`Observability::directions`], by
    /// `meters`.
    #[must_use]
    pub fn motion(&self, direction: &Vector6<f64>, meters: f64) -> Isometry3<f64> {
        let mut twist = direction * meters;
        let mut rotation = twist.fixed_rows_mut::<3>(3);
        rotation /= self.length;
        let pivot: Vector3<f64> = self.pivot.coords;
        Translation3::from(pivot) * se3::exp(&twist) * Translation3::from(-pivot)
    }
}

impl NormalEquations {
    /// Returns the motions that the rows determine, regardless of frozen components.
    ///
    /// If a number is not finite, returns `None`. Cost: an eigendecomposition of a 6×6 matrix.
    #[must_use]
    pub fn observability(&self) -> Option<Observability> {
        let eigen = eigen(self.scaled_hessian())?;
        let mut order = [0, 1, 2, 3, 4, 5];
        order.sort_unstable_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        // Without information, this avoids a division of zero by zero.
        let largest = eigen.eigenvalues[order[5]].max(f64::MIN_POSITIVE);
        let relative = |i: usize| (eigen.eigenvalues[i] / largest).max(0.0);
        Some(Observability {
            eigenvalues: order.map(relative),
            directions: order.map(|i| eigen.eigenvectors.column(i).into_owned()),
            pivot: self.pivot,
            length: self.length,
        })
    }
}
