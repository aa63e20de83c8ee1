//! Cameras, images, and observations with their normals.

pub(crate) mod camera;
pub(crate) mod image;
pub(crate) mod normals;
pub(crate) mod observation;
pub(crate) mod projection;
pub(crate) mod region;
