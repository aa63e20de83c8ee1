//! Points with normals.

use nalgebra::{Point3, UnitVector3};

/// A surface element: a point in meters and the unit normal of the surface there.
///
/// The frame depends on the source. Surfels of a model are in the object frame, and their normals
/// point out of the object. Observed surfels are in the camera frame, and their normals face the
/// camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surfel {
    /// Position, meters.
    pub point: Point3<f32>,
    /// Unit normal.
    pub normal: UnitVector3<f32>,
}
