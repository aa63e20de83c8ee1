//! Tests of error metrics.

mod generalized;
mod own_metric;
mod point_to_plane;
mod point_to_plane_limits;
mod point_to_point;
mod point_to_point_limits;
mod rows;
mod symmetric;
