//! Integration tests of `hicp-core`: one program, so that it is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::float_cmp,
    clippy::missing_panics_doc,
    clippy::must_use_candidate,
    clippy::panic,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "helpers of tests"
)]

mod camera;
mod correspondences;
mod decimation;
mod derived;
mod diameter;
mod label;
mod mesh;
mod mesh_survey;
mod model;
mod normals;
mod normals_definition;
mod normals_limits;
mod observation;
mod render;
mod rotation;
mod se3;
mod sides;
mod so3;
mod support;
mod symmetry;
