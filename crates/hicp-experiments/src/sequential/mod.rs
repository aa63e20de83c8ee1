//! The sequential study (§VI-C): trajectories toward an object, along which estimates are fused.
//!
//! Modules in reading order: `rule` (how estimates are fused), `config`, `trajectory` (the camera's path and the start), `runner` (the
//! rows of one trajectory), `row`, `study` (running, resuming, reading), `claims`, `calibration` (are covariances what
//! errors say), `report`.

mod calibration;
mod claims;
mod config;
mod report;
mod row;
mod rule;
mod runner;
mod study;
mod trajectory;

pub use config::{TrajectoryClock, TrajectoryConfig, UnderlyingRecord};
pub use report::TrajectoryReport;
pub use row::{TRAJECTORY_COLUMNS, TrajectoryRow};
pub use rule::FusionRule;
pub use runner::{TrajectoryStep, watch_trajectories};
pub use study::{TRAJECTORIES_FILE, TrajectoryStudy, run_trajectories};
