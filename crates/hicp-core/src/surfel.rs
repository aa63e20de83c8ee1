//! Points with normals.

use nalgebra::{Point3, UnitVector3};

/// A surface element: a point in metres and the unit normal of the surface there.
///
/// The frame is said by whoever hands it out: model surfels are in the object frame and their normals point out of the
/// object; observed surfels are in the camera frame and their normals face the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surfel {
    /// Position, metres.
    pub point: Point3<f32>,
    /// Unit normal.
    pub normal: UnitVector3<f32>,
}
