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
    /// `rotation` those of φ. The loss is minimized over the others. Without a frozen translation,
    /// the center does not matter. A second call replaces the first.
    pub fn freeze(
        &mut self,
        camera_from_axes: &UnitQuaternion<f64>,
        center: &Point3<f64>,
        translation: [bool; 3],
        rotation: [bool; 3],
    ) {
        let ([x, y, z], [rx, ry, rz]) = (translation, rotation);
        let held = [x, y, z, rx, ry, rz];
        // The same constraint, but without lever arms to a center that may be far away.
        let center = if translation.contains(&true) {
            *center
        } else {
            self.pivot
        };
        self.freedom = held.contains(&true).then_some(Freedom {
            axes: *camera_from_axes,
            center,
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

    /// Returns the matrix B of z = B y.
    ///
    /// Its columns are zero for frozen components. The others are an orthonormal basis of the free
    /// motions, so that eigenvalues do not depend on the distance of the center. The first three
    /// are translations along the axes.
    pub(crate) fn basis(&self) -> Matrix6<f64> {
        let Some(freedom) = &self.freedom else {
            return Matrix6::identity();
        };
        let axes = freedom.axes.to_rotation_matrix().into_inner();
        let lever = hat(&(self.pivot - freedom.center)) * axes / -self.length;
        let motions = blocks(&axes, &lever, &axes);
        let mut basis = Matrix6::zeros();
        for component in (0..6).filter(|&i| !self.held(i)) {
            let mut column: Vector6<f64> = motions.column(component).into_owned();
            for other in basis.column_iter().take(component) {
                column -= other * other.dot(&column);
            }
            basis.set_column(component, &column.normalize());
        }
        basis
    }

    /// Returns the motion of the camera frame for the unknowns y.
    pub(crate) fn increment(&self, y: &Vector6<f64>) -> Isometry3<f64> {
        let halves = |z: &Vector6<f64>| -> [Vector3<f64>; 2] {
            let rotation = z.fixed_rows::<3>(3) / self.length;
            [z.fixed_rows::<3>(0).into_owned(), rotation]
        };
        let Some(freedom) = &self.freedom else {
            // The exponential around the pivot.
            let [first, second] = halves(y);
            let about_pivot = Isometry3::from_parts(
                Translation3::from(so3::left_jacobian(&second) * first),
                so3::exp(&second),
            );
            let pivot = self.pivot.coords;
            return Translation3::from(pivot) * about_pivot * Translation3::from(-pivot);
        };
        let [first, second] = halves(&(self.basis() * y));
        let of_center = first + second.cross(&(freedom.center - self.pivot));
        let along_axes = freedom.axes.inverse();
        let [mut shift, mut turn] = [of_center, second].map(|vector| along_axes * vector);
        // Exactly zero instead of the rounding of the basis.
        for axis in 0..3 {
            if self.held(axis) {
                shift[axis] = 0.0;
            }
            if self.held(axis + 3) {
                turn[axis] = 0.0;
            }
        }
        // Not the exponential: its screw motion would displace the center along frozen axes to
        // second order.
        let rotation = so3::exp(&(freedom.axes * turn));
        let center = freedom.center.coords;
        // Without a rotation, the displacement must be exactly zero instead of the rounding of c −
        // R c.
        let swing = if turn == Vector3::zeros() {
            Vector3::zeros()
        } else {
            center - rotation * center
        };
        Isometry3::from_parts(Translation3::from(freedom.axes * shift + swing), rotation)
    }
}
