//! Rotations and rigid motions.

pub(crate) mod rotation;
pub(crate) mod rotation_grid;
pub mod se3;
pub mod so3;
