//! Frozen components of the increment.

use hicp_core::{Matrix6, Point3, UnitQuaternion, Vector6};

/// The free components of the increment y = [δ; θ].
///
/// δ is the displacement of a center and θ = L φ the scaled rotation, both along given axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Freedom {
    pub(crate) axes: UnitQuaternion<f64>,
    pub(crate) center: Point3<f64>,
    pub(crate) held: [bool; 6],
}

/// Returns BᵀHB and Bᵀg: the equations of y, with zero rows and columns for frozen components.
pub(crate) fn reduce(
    basis: &Matrix6<f64>,
    hessian: &Matrix6<f64>,
    gradient: &Vector6<f64>,
) -> (Matrix6<f64>, Vector6<f64>) {
    (
        basis.transpose() * hessian * basis,
        basis.transpose() * gradient,
    )
}
