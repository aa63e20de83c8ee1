//! Integration tests of the whole workspace, in one program that is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::unwrap_used,
    reason = "helpers of tests"
)]

mod allocations;
mod allocations_custom;
mod beyond;
mod book;
mod catalogue;
mod clouds;
mod concurrency;
mod cross;
mod custom_association;
mod custom_filter;
mod custom_fuser;
mod custom_metric;
mod custom_observer;
mod custom_part;
mod custom_renderer;
mod custom_score;
mod custom_selection;
mod custom_stage;
mod custom_stop_rule;
mod custom_switcher;
mod degeneracy_scenes;
mod determinism;
mod estimate;
mod facade;
mod fuzz_regressions;
mod hostile;
mod metrics;
mod nees;
mod numbers;
mod pipeline_files;
mod pipeline_limits;
mod pitfalls;
mod pitfalls_page;
mod presets;
mod ray_shift;
mod resolution;
mod room;
mod sequential;
mod serialization;
mod stages;
mod starts;
mod tracker;
mod ycbv;

#[global_allocator]
static COUNTING: hicp_tests::allocations::Counting = hicp_tests::allocations::Counting;
