//! Integration tests of `hicp-raster`: one program, so that it is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::unwrap_used,
    dead_code,
    reason = "helpers of tests"
)]

mod common;
mod edges;
mod invariance;
mod raycast;
mod robustness;
