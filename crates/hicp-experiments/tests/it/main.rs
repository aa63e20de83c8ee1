//! Integration tests of `hicp-experiments`, in one program that is linked once.

#![allow(clippy::panic, clippy::unwrap_used, reason = "helpers of tests")]

mod claims;
mod common;
mod running;
mod sequential;
mod sizes_and_names;
mod stored_studies;
