//! The input of a refinement: cameras, images and models.

pub(crate) mod camera;
pub(crate) mod color;
pub(crate) mod depth;
pub(crate) mod image;
pub(crate) mod model;
pub(crate) mod observation;
