//! Integration tests of `hicp-io`, in one program to link only once.

#![allow(
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "helpers of tests"
)]

mod any_bytes;
mod awkward_files;
mod common;
mod dataset_paths;
mod hostile_files;
mod hostile_images;
mod json_limits;
mod results;
mod unwritable_numbers;
mod ycbv;
