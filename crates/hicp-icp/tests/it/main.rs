//! Integration tests of `hicp-icp`: one program, so that it is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "helpers of tests"
)]

mod composition;
mod engine;
mod registration;
mod script;
mod stop_rules;

mod support;
