//! Tests of cameras and of images with their normals.

mod camera;
mod decimation;
mod normals;
mod normals_definition;
mod normals_limits;
mod observation;
