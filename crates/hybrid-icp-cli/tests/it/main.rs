//! Integration tests of `hybrid-icp-cli`, in one program so that it is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    dead_code,
    reason = "helpers of tests"
)]

mod align;
mod book;
mod bop;
mod command_line;
mod common;
mod demo;
mod experiment;
mod files;
mod help_examples;
mod inspect;
mod objects;
mod pipelines;
mod refine;
mod track;
mod ycbv;
