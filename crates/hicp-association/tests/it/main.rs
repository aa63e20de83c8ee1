//! Integration tests of `hicp-association`: one program, so that it is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "helpers of tests"
)]

mod associations;
mod boundary_targets;
mod common;
mod filters;
mod filters_and_weights;
mod nearest_neighbor;
mod nested_selections;
mod projective;
mod selections;
mod surface_and_silhouette;

mod support;
