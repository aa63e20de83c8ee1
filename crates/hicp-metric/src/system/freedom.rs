//! Frozen components of the increment.

use hicp_core::{Point3, UnitQuaternion};

/// The frozen components of the increment [δ; φ].
///
/// δ is the displacement of a center and φ the rotation around it, both along given axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Freedom {
    pub(crate) axes: UnitQuaternion<f64>,
    pub(crate) center: Point3<f64>,
    pub(crate) held: [bool; 6],
}
