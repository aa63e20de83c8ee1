//! Tests of meshes, models and symmetries.

mod diameter;
mod mesh;
mod mesh_survey;
mod model;
mod sides;
mod symmetry;
