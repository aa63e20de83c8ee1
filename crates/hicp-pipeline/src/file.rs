//! Pipeline files.

use std::path::Path;

use hicp_icp::BoxedStage;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::build::Context;
use crate::catalog::Catalog;
use crate::error::{PipelineError, PipelineErrorKind, Place};
use crate::fields::Spot;
use crate::limits::PipelineLimits;
use crate::value::set;

/// Largest file that is read.
const MAX_PIPELINE_BYTES: u64 = 1 << 20;

/// A pipeline file: builds any number of pipelines, one per thread.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PipelineFile {
    text: String,
    origin: String,
    overrides: Vec<String>,
}

impl PipelineFile {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`PipelineError`] if the file cannot be read or is not TOML.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, PipelineError> {
        let path = path.as_ref();
        Self::parse(&Self::read_text(path)?, &path.to_string_lossy())
    }

    /// Reads a pipeline file as text, for callers that also store the source.
    ///
    /// # Errors
    ///
    /// [`PipelineErrorKind::Read`] if the file cannot be read, is not a regular file, or has more
    /// than 1 MiB.
    pub fn read_text(path: impl AsRef<Path>) -> Result<String, PipelineError> {
        let path = path.as_ref();
        read_small_file(path).map_err(|source| PipelineError {
            kind: PipelineErrorKind::Read,
            place: Place::of(&path.to_string_lossy(), "", None, ""),
            problem: "cannot be read".to_owned(),
            source: Some(source),
        })
    }

    /// Parses text; `origin` is its name in messages.
    ///
    /// # Errors
    ///
    /// [`PipelineErrorKind::Syntax`] if it is not TOML.
    pub fn parse(text: &str, origin: &str) -> Result<Self, PipelineError> {
        let file = Self {
            text: text.to_owned(),
            origin: origin.to_owned(),
            overrides: Vec::new(),
        };
        file.root()?;
        Ok(file)
    }

    /// Overrides a field by an assignment of the form `path=value`.
    ///
    /// The path has dots between its keys, and list indices from 0. The value is TOML or a bare
    /// word. If the pipeline lacks the first key, but its inner `stage` has it, the path starts at
    /// that stage: `milliseconds` of the preset `color` is `stage.milliseconds`.
    ///
    /// # Errors
    ///
    /// [`PipelineErrorKind::Override`] if the assignment has another form, or if all but the last
    /// key of the path do not exist. An unknown last key is reported when the pipeline is built.
    pub fn set(&mut self, assignment: &str) -> Result<(), PipelineError> {
        self.overrides.push(assignment.to_owned());
        let outcome = self.root().map(|_| ());
        if outcome.is_err() {
            self.overrides.pop();
        }
        outcome
    }

    /// Builds the pipeline. Its results have the bits of the same parts composed in Rust.
    ///
    /// # Errors
    ///
    /// [`PipelineError`] with the line, the field, the value found and what was expected;
    /// [`PipelineErrorKind::Limit`] above [`PipelineLimits::DEFAULT`].
    pub fn build(&self) -> Result<BoxedStage, PipelineError> {
        self.build_within(&PipelineLimits::DEFAULT)
    }

    /// Builds the pipeline within other limits.
    ///
    /// # Errors
    ///
    /// As [`PipelineFile::build`].
    pub fn build_within(&self, limits: &PipelineLimits) -> Result<BoxedStage, PipelineError> {
        self.build_from(Catalog::built_in(), limits)
    }

    /// Builds the pipeline from the parts of a catalog, which may include custom ones.
    ///
    /// # Errors
    ///
    /// As [`PipelineFile::build`].
    pub fn build_from(
        &self,
        catalog: &Catalog,
        limits: &PipelineLimits,
    ) -> Result<BoxedStage, PipelineError> {
        let root = self.root()?;
        let context = Context {
            entries: catalog.entries(),
            limits,
            origin: &self.origin,
            text: &self.text,
        };
        let spot = Spot {
            field: String::new(),
            start: Some(root.span().start),
        };
        let (stage, _) = context.part(root.get_ref(), spot)?;
        Ok(stage)
    }

    /// Parses the text and applies the overrides.
    fn root(&self) -> Result<Spanned<DeValue<'_>>, PipelineError> {
        let table = DeTable::parse(&self.text).map_err(|error| {
            let start = error.span().map(|span| span.start);
            let place = Place::of(&self.origin, &self.text, start, "");
            let problem = format!("not TOML: {}", error.message());
            PipelineError::new(PipelineErrorKind::Syntax, place, problem)
        })?;
        let mut root = Spanned::new(table.span(), DeValue::Table(table.into_inner()));
        for assignment in &self.overrides {
            set(&mut root, assignment)?;
        }
        Ok(root)
    }
}

/// Reads a regular file. A pipe or a device need not end.
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
