//! Integration tests of `hicp-metric`: one program, so that it is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "helpers of tests"
)]

mod decorator;
mod metric;
mod pairs;
mod scenes;
mod support;
mod system;
