//! Tests of rotations and rigid motions.

mod rotation;
mod se3;
mod so3;
