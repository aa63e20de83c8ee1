//! Pipelines from TOML files.
//!
//! A file describes a stage: a table whose `type` names a part of the [`Catalog`] and whose other
//! fields are the parameters of that part. A part may be given by its bare name if none of its
//! parameters is set.
//!
//! **Should you use this crate?** Use it through `hybrid_icp::pipeline`, unless you write a program
//! that only checks or lists pipeline files.
//!
//! ```
//! use hicp_pipeline::PipelineFile;
//! # fn main() -> Result<(), hicp_pipeline::PipelineError> {
//! let mut file = PipelineFile::parse(
//!     r#"
//!     type = "icp"
//!     selection = "visible-surface"
//!     association = "projective"
//!     filter = [{ type = "max-distance", limit = 0.25 }]
//!     metric = "point-to-plane"
//!     "#,
//!     "example",
//! )?;
//! file.set("selection.points=500")?;
//! let stage = file.build()?;
//! # let _ = stage;
//! let misspelt = PipelineFile::parse("type = \"icq\"", "example")?;
//! assert!(misspelt.build().is_err_and(|e| e.to_string().contains("did you mean \"icp\"?")));
//! # Ok(()) }
//! ```

#![allow(
    clippy::missing_errors_doc,
    reason = "`Parameters` states the error of all its methods"
)]

mod build;
mod catalog;
mod error;
mod fields;
mod file;
mod kind;
mod limits;
mod parameters;
mod part;
mod parts;
pub mod range;
mod value;
mod work;

pub use build::Parameters;
pub use catalog::{
    BoxedAssociation, BoxedFilter, BoxedMetric, BoxedScore, BoxedSelection, BoxedStop,
    BoxedSwitcher, Catalog,
};
pub use error::{PipelineError, PipelineErrorKind, Place};
pub use file::PipelineFile;
pub use kind::{BoxedPart, PartKind};
pub use limits::PipelineLimits;
pub use part::{Accepts, Parameter, Part};
pub use range::Range;
pub use work::Limited;
