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

mod correspondences;
mod derived;
mod label;
mod object;
mod pose;
mod render;
mod sensor;
mod support;
