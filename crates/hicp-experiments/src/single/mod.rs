//! Studies of single images (§VI-A, §VI-B, Table I and the tuning of α).

mod aims;
mod claims;
mod config;
mod design;
mod experiment;
mod report;
mod runner;

pub use claims::{TABLE_I, claims};
pub use config::Config;
pub use experiment::{Condition, Experiment, MaskFault};
