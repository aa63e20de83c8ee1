//! The directions in which an image determines a registered pose.

use hicp_core::internal::small::{eigen6, inverse6};
use hicp_core::nalgebra::{Const, SymmetricEigen};
use hicp_core::{Isometry3, Matrix6, Translation3, Vector6, se3};

use crate::extent::{DIFFERENT_DIAMETERS, Extent, moved, squares};

/// Information of a direction, relative to the best determined one, that is little.
const WEAK: f64 = 0.01;
/// Rise of the score up to which an image does not contradict a move.
const SAME_SCORE: f64 = 0.03;

/// The information of a registration, around the object's center.
pub(crate) struct Registered {
    /// Information in displacements of the surface, by direction.
    eigen: SymmetricEigen<f64, Const<6>>,
    /// The map from a displacement of the pose to one of the surface, and its inverse.
    displacement: Matrix6<f64>,
    unit: Matrix6<f64>,
}

impl Registered {
    /// Changes the information of a registration to the object's center.
    ///
    /// `information` is for the twist around the camera's origin.
    pub(crate) fn new(information: &Matrix6<f64>, extent: &Extent, pose: &Isometry3<f64>) -> Self {
        let displacement = extent.displacement(pose);
        let unit = inverse6(&displacement).unwrap_or_else(Matrix6::identity);
        let change = camera_from_center(extent, pose) * unit;
        let none = SymmetricEigen {
            eigenvectors: Matrix6::identity(),
            eigenvalues: Vector6::zeros(),
        };
        Self {
            eigen: eigen6(&(change.transpose() * information * change)).unwrap_or(none),
            displacement,
            unit,
        }
    }

    /// Forgets the information in open directions, and returns them.
    ///
    /// A direction of little information is open if the image does not contradict a move in it
    /// ([`is_open`]), because facets of a mesh and noise have some in each one. An example is the
    /// rotation of a mug whose handle is hidden. Directions are displacements of the pose that move
    /// the surface by 1 m. Cost: up to two scores for each direction of little information.
    pub(crate) fn forget_open(
        &mut self,
        extent: &Extent,
        pose: &Isometry3<f64>,
        mve: f64,
        mut score: impl FnMut(&Isometry3<f64>) -> f64,
    ) -> Vec<Vector6<f64>> {
        let least = WEAK * self.eigen.eigenvalues.max();
        let mut open = Vec::new();
        for index in 0..6 {
            if self.eigen.eigenvalues[index] < least {
                let direction = self.unit * self.eigen.eigenvectors.column(index);
                if is_open(&direction, extent, pose, mve, &mut score) {
                    self.eigen.eigenvalues[index] = 0.0;
                    open.push(direction);
                }
            }
        }
        open
    }

    /// Returns the covariance of the pose.
    ///
    /// Directions without information get a large one. `scale` is the variance of a residual, and
    /// `floor` is added.
    pub(crate) fn covariance(self, scale: f64, floor: [f64; 2], unknown: [f64; 2]) -> Matrix6<f64> {
        let prior = Matrix6::from_diagonal(&squares(unknown).map(|x| 1.0 / x));
        let information = self.eigen.recompose() / scale;
        let information = self.displacement.transpose() * information * self.displacement + prior;
        let floor = Matrix6::from_diagonal(&squares(floor));
        let covariance = inverse6(&information);
        covariance.unwrap_or_else(|| Matrix6::from_diagonal(&squares(unknown))) + floor
    }
}

/// Returns `true` if an image does not contradict a move by a tenth of the diameter.
///
/// `mve` is the score of the pose.
pub(crate) fn is_open(
    direction: &Vector6<f64>,
    extent: &Extent,
    pose: &Isometry3<f64>,
    mve: f64,
    mut score: impl FnMut(&Isometry3<f64>) -> f64,
) -> bool {
    let step = DIFFERENT_DIAMETERS * extent.diameter;
    [step, -step].iter().any(|meters| {
        let away = moved(pose, &extent.center, &(direction * *meters));
        score(&away) < mve + SAME_SCORE
    })
}

/// Returns the map from a displacement of the pose to the twist around the camera's origin.
pub(crate) fn camera_from_center(extent: &Extent, pose: &Isometry3<f64>) -> Matrix6<f64> {
    let center = Translation3::from((pose * extent.center).coords);
    se3::adjoint(&Isometry3::from(center))
}

#[cfg(test)]
mod tests {
    use hicp_core::Vector3;
    use hicp_core::internal::small::join;
    use hicp_sim::Household;

    use super::*;

    #[test]
    fn directions_without_information_stay_uncertain() {
        let extent = Extent::new(&Household::Carton.model().unwrap());
        let pose = Isometry3::translation(0.1, 0.0, 0.8);
        let center = pose * extent.center;
        // Rows of a plane z = const: x, y and the rotation around z are not determined.
        let mut information = Matrix6::zeros();
        for (x, y) in [(-0.1, -0.1), (0.1, -0.1), (0.0, 0.1), (0.1, 0.1)] {
            let point = center.coords + Vector3::new(x, y, 0.0);
            let row = join(&Vector3::z(), &point.cross(&Vector3::z()));
            information += row * row.transpose();
        }
        let open = |mve: f64| {
            let mut registered = Registered::new(&information, &extent, &pose);
            registered.forget_open(&extent, &pose, 0.1, |_| mve)
        };
        assert_eq!((open(0.12).len(), open(0.14).len()), (3, 0));
        for direction in open(0.12) {
            let moves = (extent.displacement(&pose) * direction).norm();
            assert!(
                (moves - 1.0).abs() < 1e-9 && direction[2].abs() < 1e-9,
                "{direction}"
            );
        }
        let registered = Registered::new(&information, &extent, &pose);
        let covariance = registered.covariance(1e-6, [0.0; 2], [0.1, 1.0]);
        let deviations = covariance.diagonal().map(f64::sqrt);
        for determined in [2, 3, 4] {
            assert!(deviations[determined] < 0.02, "{deviations}");
        }
        assert!(deviations[0] > 0.09 && deviations[1] > 0.09 && deviations[5] > 0.9);
    }
}
