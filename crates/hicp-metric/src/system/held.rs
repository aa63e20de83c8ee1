//! Normal equations with frozen components of the increment.

use hicp_core::internal::small::blocks;
use hicp_core::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use hicp_core::{so3, so3::hat};

use crate::system::freedom::Freedom;
use crate::system::normal_equations::NormalEquations;

impl NormalEquations {
    /// Freezes components of the increment at zero, for every way of solving.
    ///
    /// The increment displaces `center` (camera frame, meters) by δ and rotates around it by φ.
    /// `translation` selects the frozen components of δ along the axes of `camera_from_axes`, and
    /// `rotation` those of φ. The loss is minimized over the others. A second call replaces the
    /// first.
    pub fn freeze(
        &mut self,
        camera_from_axes: &UnitQuaternion<f64>,
        center: &Point3<f64>,
        translation: [bool; 3],
        rotation: [bool; 3],
    ) {
        let ([x, y, z], [rx, ry, rz]) = (translation, rotation);
        let held = [x, y, z, rx, ry, rz];
        self.freedom = held.contains(&true).then_some(Freedom {
            axes: *camera_from_axes,
            center: *center,
            held,
        });
    }

    /// Returns the number of unknowns that are not frozen.
    pub(crate) fn n_free(&self) -> usize {
        let held = self.freedom.map_or([false; 6], |freedom| freedom.held);
        6 - held.iter().filter(|held| **held).count()
    }

    /// Returns whether an unknown is frozen.
    pub(crate) fn held(&self, component: usize) -> bool {
        self.freedom.is_some_and(|freedom| freedom.held[component])
    }

    /// Returns the matrix B of z = B y, whose columns are zero for frozen components.
    pub(crate) fn basis(&self) -> Matrix6<f64> {
        let Some(freedom) = &self.freedom else {
            return Matrix6::identity();
        };
        let axes = freedom.axes.to_rotation_matrix().into_inner();
        let lever = hat(&(self.pivot - freedom.center)) * axes / -self.length;
        let mut basis = blocks(&axes, &lever, &axes);
        for (component, mut column) in basis.column_iter_mut().enumerate() {
            if freedom.held[component] {
                column.fill(0.0);
            }
        }
        basis
    }

    /// Returns the motion of the camera frame for the unknowns y.
    pub(crate) fn increment(&self, y: &Vector6<f64>) -> Isometry3<f64> {
        let first: Vector3<f64> = y.fixed_rows::<3>(0).into_owned();
        let second: Vector3<f64> = y.fixed_rows::<3>(3) / self.length;
        let Some(freedom) = &self.freedom else {
            // The exponential around the pivot.
            let about_pivot = Isometry3::from_parts(
                Translation3::from(so3::left_jacobian(&second) * first),
                so3::exp(&second),
            );
            let pivot = self.pivot.coords;
            return Translation3::from(pivot) * about_pivot * Translation3::from(-pivot);
        };
        // Not the exponential: its screw motion would displace the center along frozen axes to
        // second order.
        let rotation = so3::exp(&(freedom.axes * second));
        let center = freedom.center.coords;
        // Without a rotation, the displacement must be exactly zero instead of the rounding of c −
        // R c.
        let swing = if second == Vector3::zeros() {
            Vector3::zeros()
        } else {
            center - rotation * center
        };
        Isometry3::from_parts(Translation3::from(freedom.axes * first + swing), rotation)
    }
}
