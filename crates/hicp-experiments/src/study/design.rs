//! The trait that every kind of study implements.

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

/// Evaluates a case, given the indices of the object and of the case.
///
/// Returns the outcomes, ordered by setting and then by variant. Each thread has one.
pub type Worker<'a> = Box<dyn FnMut(usize, u64) -> Vec<Outcome> + 'a>;

/// A kind of study, defined by the configuration that is stored next to its rows.
pub trait Design: Clone + Debug + PartialEq + Sync + Serialize + DeserializeOwned {
    /// Name of the file of rows.
    const ROWS_FILE: &'static str;
    /// The columns of that file.
    const COLUMNS: &'static Columns;

    /// Checks every field that was read, or that a caller has changed.
    ///
    /// # Errors
    ///
    /// [`IoError`] with the name of the first wrong field.
    fn check(&self, fields: &Fields<'_>) -> Result<(), IoError>;

    /// Returns the rows of the study and their order.
    fn layout(&self) -> Layout<'_>;

    /// Creates the worker of a thread. It stores reconstructions in `models`.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when a pipeline cannot be built.
    fn worker<'a>(
        &'a self,
        subjects: &'a [Subject],
        models: &'a Models,
    ) -> Result<Worker<'a>, ExperimentError>;

    /// Returns the names that the analysis compares. By default, these are the variants.
    fn compared(&self) -> Vec<String> {
        let variants = self.layout().variants.into_iter();
        variants.map(str::to_owned).collect()
    }

    /// Returns the groups of rows that are averaged: single bins or levels first, all rows last.
    fn groups(&self) -> Vec<Group>;
}
