//! Meshes, models and symmetries.

pub(crate) mod diameter;
pub(crate) mod mesh;
pub(crate) mod mesh_survey;
pub(crate) mod model;
pub(crate) mod sampling;
pub(crate) mod sides;
pub(crate) mod simplify;
pub(crate) mod surface_color;
pub(crate) mod symmetry;
