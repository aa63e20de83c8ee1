//! Integration tests of `hicp-fusion`: one program, so that it is linked once.

#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    dead_code,
    reason = "helpers of tests"
)]

mod common;
mod decorators;
mod estimates;
mod fusion;
mod methods;
mod motion;
mod solver;
mod support;
mod symmetry;
