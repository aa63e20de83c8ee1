//! The studies.
mod clock;
mod config;
mod error;
mod experiment;
mod row;
mod runner;
mod study;
mod subject;
mod variant;

pub use config::{CameraRecord, Config, ObjectRecord, VariantRecord};
pub use error::ExperimentError;
pub use experiment::{Condition, Experiment};
pub use row::{COLUMNS, Measured, Row};
pub use study::{CASES_FILE, CONFIG_FILE, RunOptions, Study, run};
pub use subject::Subject;
pub use variant::Variant;
