//! The studies of the Hybrid ICP paper, as code: single images (§VI-A, §VI-B, Table I and the
//! tuning of α) and trajectories (§VI-C).
//!
//! **Should you use this crate?** Use it to check the paper's claims, or to compare a custom
//! pipeline with the paper's nine variants on many objects. Its command line is
//! `hybrid-icp experiment`. To refine poses, use `hybrid-icp`.
//!
//! A study runs every variant on the same cases: an object, an image and an initial pose, at one or
//! more levels of noise. Differences between variants are therefore paired. The rows of a case are
//! written as soon as the case is finished. A study can be killed and resumed. Except for times,
//! its rows do not depend on the number of threads. There are two kinds of studies, [`Config`] and
//! [`TrajectoryConfig`]; both implement [`Design`].
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
//! let analysis = &report.entries()[0].analysis;
//! let hybrid = analysis.mean(Metric::Vsd, analysis.overall(), 0).ok_or("no row")?;
//! assert!(hybrid.low <= hybrid.estimate && hybrid.estimate <= hybrid.high);
//! report.write(folder.path())?; // report.html, figure.svg, summary.csv, …
//! # Ok(()) }
//! ```

// Counts and indices of rows become floating point numbers.
#![allow(clippy::cast_precision_loss)]

mod analysis;
mod claims;
mod clock;
mod error;
mod report;
mod sequential;
mod single;
mod study;
mod subject;
mod variant;

pub use analysis::{
    ADD_SHARE, Analysis, Cell, FAILURE_VSD, Interval, Metric, REPLICATES, WORSE_VSD, never_seen,
    quantile,
};
pub use claims::{Claim, ClaimVerdict, EQUIVALENT_VSD};
pub use error::ExperimentError;
pub use report::{
    Curve, Document, Entry, Figure, Panel, ReportOf, Reported, Table, html_escaped, html_page,
};
pub use sequential::{
    FusionRule, PathDirection, PlainCovariance, TrajectoryClock, TrajectoryConfig, TrajectoryStep,
    UnderlyingRecord, watch_trajectories,
};
pub use single::{Condition, Config, Experiment, TABLE_I, claims};
pub use study::{
    ALL, CONFIG_FILE, Design, FAULTY_MASK, Fields, Group, HIGH, LOW, Layout, MAX_BINS, MAX_CELLS,
    MAX_OBJECTS, Measured, Models, NOISY, NOISY_DEPTH, NOISY_MODEL, ObjectRecord, Outcome, Row,
    RunOptions, StudyOf, Worker, run,
};
pub use subject::Subject;
pub use variant::Variant;

/// A study of single images.
pub type Study = StudyOf<Config>;
/// A sequential study.
pub type TrajectoryStudy = StudyOf<TrajectoryConfig>;
/// A report of studies of single images.
pub type Report = ReportOf<Config>;
/// A report of sequential studies.
pub type TrajectoryReport = ReportOf<TrajectoryConfig>;
