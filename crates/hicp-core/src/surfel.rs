//! Points with normals.

use nalgebra::{Point3, UnitVector3, Vector3};

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

impl Surfel {
    /// The entry of a pixel without a surfel. Its depth is 0.
    pub(crate) const NOTHING: Self = Self {
        point: Point3::new(0.0, 0.0, 0.0),
        normal: UnitVector3::new_unchecked(Vector3::new(0.0, 0.0, 1.0)),
    };
}
