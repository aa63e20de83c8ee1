//! Integration tests of `hicp-metric`: one program, so that it is linked once.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "helpers of tests"
)]

mod covariance;
mod damping;
mod degeneracy;
mod equations;
mod frozen;
mod generalized;
mod own_metric;
mod pairs;
mod photometric;
mod point_to_plane;
mod point_to_plane_limits;
mod point_to_point;
mod point_to_point_limits;
mod prior;
mod ratios;
mod robust;
mod rows;
mod sandwich;
mod scenes;
mod solvers;
mod symmetric;
mod wrappers;

mod support;
