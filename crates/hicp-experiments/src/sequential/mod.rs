//! The sequential study (§VI-C): trajectories toward an object, along which estimates are fused.

mod calibration;
mod claims;
mod config;
mod design;
mod report;
mod rule;
mod runner;
mod step;
mod trajectory;

pub use config::{PathDirection, TrajectoryClock, TrajectoryConfig, UnderlyingRecord};
pub use rule::{FusionRule, PlainCovariance};
pub use runner::watch_trajectories;
pub use step::TrajectoryStep;
