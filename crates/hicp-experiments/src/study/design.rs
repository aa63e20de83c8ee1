//! The trait that every kind of study implements.

use std::fmt::Debug;

use hicp_io::{IoError, Place};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::fields::Fields;
use super::group::Group;
use super::layout::Layout;
use super::models::Models;
use super::row::Outcome;
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
    /// The names of the columns of that file, separated by commas.
    const COLUMNS: &'static str;

    /// Checks every field that was read, or that a caller has changed.
    ///
    /// # Errors
    ///
    /// [`IoError`] with the name of the first wrong field.
    fn check(&self, fields: &Fields<'_>) -> Result<(), IoError>;

    /// Returns the configuration with one field changed: `field=value`, where the value is JSON, or
    /// text without quotes.
    ///
    /// # Errors
    ///
    /// [`IoError`] with the name of the field, if there is no such field or it cannot have the
    /// value.
    fn with(&self, change: &str) -> Result<Self, IoError> {
        let (field, text) = change.split_once('=').unwrap_or((change, ""));
        let wrong = |found: String, expected: &str| {
            IoError::new(
                "configuration",
                Place::Field(field.to_owned()),
                found,
                expected,
            )
        };
        if ["objects", "version", "experiment"].contains(&field) {
            let found = "a field that the command sets".to_owned();
            return Err(wrong(found, "another field of config.json"));
        }
        // The keys of all maps are text, so a configuration always serializes.
        let mut fields = serde_json::to_value(self).unwrap_or_default();
        let Some(value) = fields.get_mut(field) else {
            return Err(wrong("no such field".to_owned(), "a field of config.json"));
        };
        *value = serde_json::from_str(text).unwrap_or_else(|_| text.into());
        let changed: Self = serde_json::from_value(fields)
            .map_err(|error| wrong(error.to_string(), "a value that config.json could have"))?;
        changed.check(&Fields::new(&changed))?;
        Ok(changed)
    }

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
