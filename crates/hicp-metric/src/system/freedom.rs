//! Frozen components of the increment.

use hicp_core::{Point3, UnitQuaternion};

/// The free components of the increment y = [δ; θ].
///
/// δ is the displacement of a center and θ = L φ the scaled rotation, both along given axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Freedom {
    pub(crate) axes: UnitQuaternion<f64>,
    pub(crate) center: Point3<f64>,
    pub(crate) held: [bool; 6],
}
