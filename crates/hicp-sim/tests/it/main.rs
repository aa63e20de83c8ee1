//! Integration tests of `hicp-sim`: one program, so that it is linked once.

#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "helpers of tests")]

mod objects;
mod sampling;
mod solids;
mod tsdf;
