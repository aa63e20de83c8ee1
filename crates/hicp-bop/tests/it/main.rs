//! Integration tests of `hicp-bop`: one program, so that it is linked once.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod box_mask;
mod judging;
mod models;
mod refining;
mod scenes;
