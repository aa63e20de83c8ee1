//! Integration tests of `hicp-sim`, in one program to link only once.

#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "helpers of tests")]

mod objects;
mod sampling;
mod solids;
mod tsdf;
