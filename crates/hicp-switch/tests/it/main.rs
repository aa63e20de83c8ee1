//! Integration tests of `hicp-switch`: one program, so that it is linked once.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod switch;
mod until_stall;

mod support;
