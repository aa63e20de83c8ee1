//! Pipelines from TOML files.
//!
//! A file describes a stage: a table whose `type` names a part of the catalogue ([`PARTS`]) and whose other fields are that
//! part's parameters. A part without parameters of its own may be given by its bare name.
//!
//! ```
//! use hybrid_icp::PipelineFile;
//! # fn main() -> Result<(), hybrid_icp::PipelineError> {
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

// Files are read once, and their errors carry everything a person needs.
#![allow(clippy::result_large_err)]

mod build;
mod catalog;
mod error;
mod limits;
mod page;
mod parts;
mod reader;
mod search;
mod tree;

use std::path::Path;

pub use catalog::{Accepts, Parameter, Part, PartKind};
pub use error::{PipelineError, Place};
pub use limits::PipelineLimits;
pub use page::catalogue;
pub use parts::PARTS;

use crate::preset::BoxedStage;
use reader::Reader;
use tree::Node;

/// A pipeline file that has been read: it builds any number of pipelines, one per thread.
#[derive(Clone, Debug, PartialEq)]
pub struct PipelineFile {
    tree: Node,
    origin: String,
}

impl PipelineFile {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`PipelineError`] when it cannot be read or is not TOML.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, PipelineError> {
        let path = path.as_ref();
        Self::parse(&Self::read_text(path)?, &path.to_string_lossy())
    }

    /// Reads the text of a file, for who wants to keep it beside what it builds.
    ///
    /// # Errors
    ///
    /// [`PipelineError::Read`] when it cannot be read, is no regular file or has more than 1 MiB.
    pub fn read_text(path: impl AsRef<Path>) -> Result<String, PipelineError> {
        let path = path.as_ref();
        read_small_file(path).map_err(|source| PipelineError::Read {
            path: path.to_owned(),
            source,
        })
    }

    /// Parses text; `origin` is what messages call it.
    ///
    /// # Errors
    ///
    /// [`PipelineError::Syntax`] when it is not TOML.
    pub fn parse(text: &str, origin: &str) -> Result<Self, PipelineError> {
        Ok(Self {
            tree: Node::parse(text, origin)?,
            origin: origin.to_owned(),
        })
    }

    /// Overrides a field: `path=value`, the path dotted with list indices from 0, the value TOML or a bare word.
    ///
    /// # Errors
    ///
    /// [`PipelineError::Override`] when the path leads nowhere. Whether the field means anything is found when building.
    pub fn set(&mut self, assignment: &str) -> Result<(), PipelineError> {
        self.tree.set(assignment)
    }

    /// Builds the pipeline: the same parts as a struct literal, boxed, giving the same bits.
    ///
    /// # Errors
    ///
    /// [`PipelineError`] naming the line and field, what is there, and what would be right; [`PipelineError::Limit`] above
    /// [`PipelineLimits::DEFAULT`].
    pub fn build(&self) -> Result<BoxedStage, PipelineError> {
        self.build_within(&PipelineLimits::DEFAULT)
    }

    /// Builds the pipeline within limits of one's own.
    ///
    /// # Errors
    ///
    /// As [`PipelineFile::build`].
    pub fn build_within(&self, limits: &PipelineLimits) -> Result<BoxedStage, PipelineError> {
        let place = Place {
            origin: self.origin.clone(),
            line: None,
            field: String::new(),
        };
        let root = Reader::new(&self.tree, PartKind::Stage, place)?;
        let stage = build::stage(&root)?;
        limits.check(&root)?;
        Ok(stage)
    }
}

/// Largest file that is read.
const MAX_PIPELINE_BYTES: u64 = 1 << 20;

/// Reads a file that ends: a pipe or a device need not.
fn read_small_file(path: &Path) -> std::io::Result<String> {
    let metadata = std::fs::metadata(path)?;
    if metadata.is_file() && metadata.len() <= MAX_PIPELINE_BYTES {
        return String::from_utf8(std::fs::read(path)?).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            std::io::Error::other(format!(
                "byte {at}: found what is not UTF-8, expected text in UTF-8"
            ))
        });
    }
    let kind = match (metadata.is_file(), metadata.len()) {
        (true, bytes) => format!("a file of {bytes} bytes"),
        (false, _) => "no regular file".to_owned(),
    };
    Err(std::io::Error::other(format!(
        "found {kind}, expected a regular file of at most {MAX_PIPELINE_BYTES} bytes"
    )))
}
