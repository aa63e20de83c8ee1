//! The covariance of "one unit of uncertainty".

use hicp_core::{Isometry3, Matrix6, Point3, Translation3, Vector6, se3};

use crate::estimate::FusionError;
use crate::information::transported;

/// The shape of a covariance whose size is a single number, such as the paper's e_MVE·I₆ and I₆.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum UnitCovariance {
    /// I₆ in the camera frame, as in the paper.
    ///
    /// Meters and radians count alike. A rotation is around the *camera's* origin and moves the
    /// object along. The fused pose therefore depends on the camera's place.
    #[default]
    Identity,
    /// diag(r², r², r², 1, 1, 1) around the object's center.
    ///
    /// A rotation by 1 rad counts as a translation by the object's radius. It is isotropic there,
    /// so Ad(A) does not change it for any motion A.
    // Deviation: U instead of I₆: §V multiplies e_MVE by I₆, in which a meter counts like a radian
    // around the camera. `SequentialEstimator::for_object` uses U = diag(r², r², r², 1, 1, 1)
    // around the object's center, so the fused pose does not depend on the camera's place.
    // `SequentialEstimator::paper` uses I₆.
    AboutObject {
        /// The center of the object's rotations, object frame, meters.
        center: Point3<f64>,
        /// The object's radius r, meters.
        radius: f64,
    },
}

impl UnitCovariance {
    /// Creates the unit for an object; `center` and `radius` are those of `hicp_core::Model`.
    ///
    /// # Errors
    ///
    /// [`FusionError::Parameter`] if the radius is not between 10⁻⁶ and 10⁶ m, or if a coordinate
    /// of the center exceeds 10⁶ m.
    pub fn about_object(center: Point3<f64>, radius: f64) -> Result<Self, FusionError> {
        // NaN is the largest number in this order.
        let coordinates = center.iter().map(|x| x.abs());
        let farthest = coordinates.max_by(f64::total_cmp).unwrap_or_default();
        for (name, value, least, expected) in [
            ("object radius", radius, 1e-6, "1e-6 to 1e6 m"),
            (
                "largest coordinate of the object's center",
                farthest,
                0.0,
                "0 to 1e6 m",
            ),
        ] {
            if !(least..=1e6).contains(&value) {
                return Err(FusionError::Parameter {
                    name,
                    value,
                    expected,
                });
            }
        }
        Ok(Self::AboutObject { center, radius })
    }

    /// Returns the 6×6 covariance of ξ = [ρ; φ] in the camera frame for an object at a pose.
    #[must_use]
    pub fn at(&self, camera_from_object: &Isometry3<f64>) -> Matrix6<f64> {
        match *self {
            Self::Identity => Matrix6::identity(),
            Self::AboutObject { center, radius } => {
                let square = radius * radius;
                let diagonal = Vector6::new(square, square, square, 1.0, 1.0, 1.0);
                let center = Translation3::from((camera_from_object * center).coords);
                let adjoint = se3::adjoint(&Isometry3::from(center));
                transported(&Matrix6::from_diagonal(&diagonal), &adjoint)
            }
        }
    }
}
