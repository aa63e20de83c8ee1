//! Integration tests of `hicp-bop`, in one program to link only once.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod box_mask;
mod color;
mod common;
mod judging;
mod models;
mod refining;
mod scenes;
