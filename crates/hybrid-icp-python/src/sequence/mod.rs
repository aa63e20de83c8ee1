//! Poses over many frames: fused, from a moving camera, or of a moving object.

pub(crate) mod fusion;
pub(crate) mod sequential;
pub(crate) mod tracker;
