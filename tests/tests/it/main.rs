//! Integration tests of the whole workspace, in one program that is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::unwrap_used,
    reason = "helpers of tests"
)]

mod allocations;
mod clouds;
mod color;
mod concurrency;
mod custom;
mod degeneracy_scenes;
mod dense_meshes;
mod determinism;
mod facade;
mod fuzz_regressions;
mod hostile;
mod moving;
mod numbers;
mod pages;
mod photometric;
mod pipelines;
mod pitfalls;
mod plausibility;
mod presets;
mod serialization;
mod stages;

#[global_allocator]
static COUNTING: hicp_tests::allocations::Counting = hicp_tests::allocations::Counting;
