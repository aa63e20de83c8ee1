//! The covariance that stands for "one unit of uncertainty".

use hicp_core::{Isometry3, Matrix6, Point3, Translation3, Vector6, se3};

use crate::estimate::FusionError;
use crate::information::transported;

/// The shape of a covariance whose size is a single number, as the paper's e_MVE·I₆ and I₆ are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum UnitCovariance {
    /// I₆ in the camera frame, the paper's: metres and radians count alike, and a rotation is one
    /// about the *camera's* origin, which takes the object along. What is fused depends on the
    /// camera's place.
    #[default]
    Identity,
    /// diag(r², r², r², 1, 1, 1) about the object's centre: a rotation by 1 rad counts as a
    /// translation by the object's radius. Isotropic there, so that Ad(A) takes it to itself,
    /// whatever the motion A.
    AboutObject {
        /// The point that the object turns about, object frame, metres.
        center: Point3<f64>,
        /// The object's radius r, metres.
        radius: f64,
    },
}

impl UnitCovariance {
    /// Makes the unit about an object; `center` and `radius` are those of `hicp_core::Model`.
    ///
    /// # Errors
    ///
    /// [`FusionError::Parameter`] when the radius is not between 10⁻⁶ and 10⁶ m or the centre not
    /// within 10⁶ m.
    pub fn about_object(center: Point3<f64>, radius: f64) -> Result<Self, FusionError> {
        let farthest = center.coords.amax();
        for (name, value, least, expected) in [
            ("object radius", radius, 1e-6, "1e-6 to 1e6 m"),
            (
                "distance of the object's centre",
                farthest,
                0.0,
                "0 to 1e6 m",
            ),
        ] {
            if !(least..=1e6).contains(&value) || !center.coords.iter().all(|x| x.is_finite()) {
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
