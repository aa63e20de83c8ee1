//! The studies of the Hybrid ICP paper, as code: single images (§VI-A, §VI-B, Table I and the tuning of α) and trajectories (§VI-C).
//!
//! **Should you use this crate?** To check the paper's claims, or to judge a pipeline of your own against its nine variants on
//! many objects, yes; `hybrid-icp experiment` is its command line. To refine poses, no: that is `hybrid-icp`.
//!
//! A study looks at cases (an object, an image, an initial pose) under one or more levels of noise and gives each to every variant:
//! differences between variants are paired by construction. It writes a row per case, level and variant as it goes, can be killed
//! and resumed, and comes out the same on any number of threads, but for the times.
//!
//! ```
//! use std::ops::ControlFlow;
//! use hicp_experiments::{Config, Experiment, Metric, Report, RunOptions, Study, Subject, Variant, run};
//! use hicp_sim::Household;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = tempfile::tempdir()?;
//! let subjects = Subject::household(&[Household::Mug])?;
//! let config = Config::new(Experiment::DepthNoise, &subjects, &Variant::paper(), 1, 7)?;
//! let options = RunOptions { threads: 1, ..RunOptions::default() };
//! run(&config, &subjects, folder.path(), options, &mut |_| ControlFlow::Continue(()))?;
//!
//! let study = Study::read(folder.path())?;
//! assert_eq!(study.rows.len(), 6 * 9); // six levels of noise, nine variants
//! let report = Report::of(vec![("mug".to_owned(), study)]);
//! let (_, analysis) = &report.analyses()[0];
//! let hybrid = analysis.mean(Metric::Vsd, analysis.overall(), 0).ok_or("no row")?;
//! assert!(hybrid.low <= hybrid.estimate && hybrid.estimate <= hybrid.high);
//! report.write(folder.path())?; // report.html, figure.svg, summary.csv, …
//! # Ok(()) }
//! ```

// Counts and indices of rows become floating point numbers.
#![allow(clippy::cast_precision_loss)]

mod aims;
mod analysis;
mod claims;
mod clock;
mod config;
mod error;
mod experiment;
mod figure;
mod html;
mod report;
mod row;
mod runner;
mod sequential;
mod stored;
mod streaming;
mod study;
mod subject;
mod tables;
mod variant;

pub use analysis::{
    ADD_SHARE, ALL, Analysis, Cell, FAILURE_VSD, FAULTY_MASK, Group, HIGH, Interval, LOW, Metric,
    NOISY, NOISY_DEPTH, NOISY_MODEL, REPLICATES, WORSE_VSD, never_seen,
};
pub use claims::{Claim, ClaimVerdict, TABLE_I, claims};
pub use config::{CameraRecord, Config, ObjectRecord, VariantRecord};
pub use error::ExperimentError;
pub use experiment::{Condition, Experiment, MaskFault};
pub use figure::{Curve, Figure, Panel};
pub use html::{Table, escaped as html_escaped, page as html_page};
pub use report::Report;
pub use row::{COLUMNS, Measured, Row};
pub use sequential::{
    FusionRule, TRAJECTORIES_FILE, TRAJECTORY_COLUMNS, TrajectoryClock, TrajectoryConfig,
    TrajectoryReport, TrajectoryRow, TrajectoryStep, TrajectoryStudy, UnderlyingRecord,
    run_trajectories, watch_trajectories,
};
pub use stored::{MAX_BINS, MAX_CELLS, MAX_OBJECTS};
pub use study::{CASES_FILE, CONFIG_FILE, RunOptions, Study, run};
pub use subject::Subject;
pub use variant::Variant;
