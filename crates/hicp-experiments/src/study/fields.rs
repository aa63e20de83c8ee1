//! Checks of the fields of a configuration.

use std::collections::HashSet;
use std::fmt::Display;
use std::path::Path;

use hicp_io::{IoError, Place};
use serde::Serialize;
use serde_json::Value;

use super::layout::Layout;
use super::row::quoted;

/// Largest number of bins of the initial VSD in a study. The paper has ten.
pub const MAX_BINS: usize = 1000;
/// Largest number of objects of a study.
pub const MAX_OBJECTS: usize = 10_000;
/// Largest product of settings, variants and bins. The analysis uses about 128 kB per cell.
pub const MAX_CELLS: usize = 10_000;

type Checked = Result<(), IoError>;

/// The fields of a configuration by name. Errors state the path and the name.
#[derive(Debug)]
pub struct Fields<'a> {
    path: &'a Path,
    values: Value,
}

impl<'a> Fields<'a> {
    /// Creates the fields of a configuration that is not in a file.
    pub(crate) fn new(config: &impl Serialize) -> Self {
        Self::of(Path::new("configuration"), config)
    }

    /// Creates the fields of a configuration in the file `path`.
    pub(crate) fn of(path: &'a Path, config: &impl Serialize) -> Self {
        // The keys of all maps are text, so a configuration always serializes.
        let values = serde_json::to_value(config).unwrap_or_default();
        Self { path, values }
    }

    /// Refuses a field unless `is_valid`.
    pub(crate) fn require(
        &self,
        is_valid: bool,
        field: impl Display,
        found: impl Display,
        expected: impl Display,
    ) -> Checked {
        if is_valid {
            return Ok(());
        }
        let place = Place::Field(field.to_string());
        let (found, expected) = (found.to_string(), expected.to_string());
        Err(IoError::new(self.path, place, found, expected))
    }

    /// Refuses a count that is not from 1 to `most`.
    pub(crate) fn count(&self, field: &str, most: u64) -> Checked {
        let found = &self.values[field];
        let is_valid = found.as_u64().is_some_and(|n| (1..=most).contains(&n));
        self.require(is_valid, field, found, format_args!("1 to {most}"))
    }

    /// Refuses numbers that are negative or not finite, which JSON stores as null.
    pub(crate) fn at_least_0(&self, fields: &[&str]) -> Checked {
        fields.iter().try_for_each(|field| {
            let found = &self.values[field];
            let is_valid = found.as_f64().is_some_and(|x| x >= 0.0);
            self.require(is_valid, field, found, "a number of at least 0")
        })
    }

    /// Refuses numbers that are not above 0, or not finite.
    pub(crate) fn above_0(&self, fields: &[&str]) -> Checked {
        let number = |field| self.values[field].as_f64().unwrap_or(f64::NAN);
        fields
            .iter()
            .try_for_each(|field| self.between(field, number(field), f64::INFINITY))
    }

    /// Refuses a number that is not above 0 and below `limit`.
    pub(crate) fn between(&self, field: impl Display, found: f64, limit: f64) -> Checked {
        let is_valid = found > 0.0 && found < limit;
        let expected = match limit.is_finite() {
            true => format!("a number above 0 and below {limit:?}"),
            false => "a number above 0".to_owned(),
        };
        self.require(is_valid, field, format_args!("{found:?}"), expected)
    }

    /// Refuses an empty list, more than `most` elements, and duplicate names.
    pub(crate) fn names(&self, field: &str, most: usize) -> Checked {
        let found = self.values[field].as_array().map_or(&[][..], Vec::as_slice);
        let n = match found.len() {
            0 => "none".to_owned(),
            n => n.to_string(),
        };
        let is_valid = (1..=most).contains(&found.len());
        self.require(is_valid, field, n, format_args!("1 to {most}"))?;
        let mut seen = HashSet::new();
        found.iter().try_for_each(|element| {
            let name = element.as_str().or(element["name"].as_str());
            let name = name.unwrap_or_default();
            let found = format!("{} twice", quoted(name));
            self.require(seen.insert(name), field, found, "different names")
        })
    }

    /// Checks the fields of every configuration: objects, bins and the size of the analysis.
    ///
    /// Objects must be smaller than `distance`, which is that from the camera in meters. `names`
    /// are the fields that list the settings and the variants.
    pub(crate) fn common(&self, layout: &Layout<'_>, distance: f64, names: [&str; 2]) -> Checked {
        self.names("objects", MAX_OBJECTS)?;
        for (index, object) in layout.objects.iter().enumerate() {
            let field = format_args!("objects[{index}].diameter_mm");
            self.between(field, object.diameter_mm, 1e3 * distance)?;
        }
        self.count("bins", MAX_BINS as u64)?;
        let (settings, variants, bins) =
            (layout.settings.len(), layout.variants.len(), layout.bins);
        let cells = settings.saturating_mul(variants).saturating_mul(bins);
        self.require(
            cells <= MAX_CELLS,
            format_args!("{} × {} × bins", names[0], names[1]),
            format_args!("{settings} × {variants} × {bins}"),
            format_args!("at most {MAX_CELLS}"),
        )
    }
}
