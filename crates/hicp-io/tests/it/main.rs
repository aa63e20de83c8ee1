//! Integration tests of `hicp-io`, in one program to link only once.

#![allow(
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "helpers of tests"
)]

mod awkward_files;
#[cfg(feature = "all-formats")]
mod camera_pose_formats;
#[cfg(feature = "all-formats")]
mod color_images;
mod common;
mod dataset_paths;
mod hostile_files;
mod hostile_images;
#[cfg(feature = "all-formats")]
mod image_formats;
mod json_limits;
#[cfg(feature = "all-formats")]
mod mesh_cloud_formats;
mod mesh_colors;
mod mesh_textures;
mod results;
mod unwritable_numbers;
mod ycbv;
