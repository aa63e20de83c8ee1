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
mod color;
mod command_line;
mod common;
mod demo;
mod doctor;
mod estimate;
mod experiment;
mod faults;
mod help_examples;
mod inspect;
mod killed_generator;
mod no_regular_files;
mod objects;
mod other_formats;
mod outputs;
mod pipeline_limits;
mod pipelines;
mod refine;
mod world;
mod ycbv;
