//! Integration tests of `hicp-testkit`, in one program to link only once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "helpers of tests"
)]

mod broken;
mod built_in;
mod documented;
mod fusers;
