//! What distinguishes one kind of study from another.

use std::fmt::Debug;

use hicp_io::IoError;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::fields::Fields;
use super::group::Group;
use super::layout::Layout;
use super::models::Models;
use super::row::{Columns, Outcome};
use crate::error::ExperimentError;
use crate::subject::Subject;

/// Evaluates a case, given the index of the object and that of the case; one per thread.
///
/// Returns the outcomes by setting, and in each by variant.
pub type Worker<'a> = Box<dyn FnMut(usize, u64) -> Vec<Outcome> + 'a>;

/// A kind of study: the configuration that is stored next to the rows, and what follows from it.
pub trait Design: Clone + Debug + PartialEq + Sync + Serialize + DeserializeOwned {
    /// Name of the file of rows.
    const ROWS_FILE: &'static str;
    /// The columns of that file.
    const COLUMNS: &'static Columns;

    /// Checks every field that was read, or that a caller has changed.
    ///
    /// # Errors
    ///
    /// [`IoError`] that names the first wrong field.
    fn check(&self, fields: &Fields<'_>) -> Result<(), IoError>;

    /// Returns the rows that the study has, and their order.
    fn layout(&self) -> Layout<'_>;

    /// Creates the worker of a thread; reconstructions go into `models`.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when a pipeline cannot be built.
    fn worker<'a>(
        &'a self,
        subjects: &'a [Subject],
        models: &'a Models,
    ) -> Result<Worker<'a>, ExperimentError>;

    /// Returns the names of what the analysis compares, one or more per case: by default the
    /// variants.
    fn compared(&self) -> Vec<String> {
        let variants = self.layout().variants.into_iter();
        variants.map(str::to_owned).collect()
    }

    /// Returns the rows that are averaged together: single bins or levels first, all rows last.
    fn groups(&self) -> Vec<Group>;
}
