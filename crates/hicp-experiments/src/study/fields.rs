//! Checks of the fields of a configuration.

use std::collections::HashSet;
use std::fmt::Display;
use std::path::Path;

use super::layout::Layout;
use super::records::{CameraRecord, ObjectRecord};
use super::row::quoted;
use crate::error::ExperimentError;

/// Most bins of the initial VSD in a study; the paper has ten.
pub const MAX_BINS: usize = 1000;
/// Most objects of a study.
pub const MAX_OBJECTS: usize = 10_000;
/// Most settings × variants × bins of a study: its analysis holds about 128 kB per cell.
pub const MAX_CELLS: usize = 10_000;

type Checked = Result<(), ExperimentError>;

/// Checks the fields of a configuration, and names the file in its errors.
#[derive(Clone, Copy, Debug)]
pub struct Fields<'a> {
    path: &'a Path,
}

impl<'a> Fields<'a> {
    /// Checks a configuration that is not from a file.
    pub(crate) fn new() -> Self {
        Self::of(Path::new("configuration"))
    }

    /// `path` is the file that the configuration is from, or is written to.
    pub(crate) fn of(path: &'a Path) -> Self {
        Self { path }
    }

    /// Refuses a field unless `is_valid`.
    pub(crate) fn require(
        self,
        is_valid: bool,
        field: impl Display,
        found: impl Display,
        expected: impl Display,
    ) -> Checked {
        if is_valid {
            return Ok(());
        }
        Err(ExperimentError::Field {
            path: self.path.to_owned(),
            field: field.to_string(),
            found: found.to_string(),
            expected: expected.to_string(),
        })
    }

    /// Refuses a count that is not from 1 to `most`.
    pub(crate) fn count(self, field: &str, count: u64, most: u64) -> Checked {
        let expected = format_args!("1 to {most}");
        self.require((1..=most).contains(&count), field, count, expected)
    }

    /// Refuses numbers that are not finite, or negative.
    pub(crate) fn not_negative(self, numbers: &[(&str, f64)]) -> Checked {
        numbers.iter().try_for_each(|(field, x)| {
            let is_valid = x.is_finite() && *x >= 0.0;
            self.require(
                is_valid,
                field,
                format_args!("{x:?}"),
                "a number of at least 0",
            )
        })
    }

    /// Refuses numbers that are not finite, or not above 0.
    pub(crate) fn positive(self, numbers: &[(&str, f64)]) -> Checked {
        numbers.iter().try_for_each(|(field, x)| {
            let is_valid = x.is_finite() && *x > 0.0;
            self.require(is_valid, field, format_args!("{x:?}"), "a number above 0")
        })
    }

    /// Refuses an empty list of names, more than `most`, and a name that is there twice.
    pub(crate) fn names(self, field: &str, most: usize, names: &[&str]) -> Checked {
        let is_valid = (1..=most).contains(&names.len());
        let found = match names.len() {
            0 => "none".to_owned(),
            n => n.to_string(),
        };
        self.require(is_valid, field, found, format_args!("1 to {most}"))?;
        let mut seen = HashSet::new();
        names.iter().try_for_each(|name| {
            let found = format_args!("{} twice", quoted(name));
            self.require(seen.insert(name), field, found, "different names")
        })
    }

    /// Checks what every configuration has: camera, objects, bins and the size of the analysis.
    ///
    /// `names` are the fields that list the settings and the variants.
    pub(crate) fn common(
        self,
        camera: &CameraRecord,
        objects: &[ObjectRecord],
        layout: &Layout<'_>,
        names: [&str; 2],
    ) -> Checked {
        if let Err(error) = camera.pinhole() {
            let found = format_args!("invalid numbers ({error})");
            self.require(false, "camera", found, "a camera")?;
        }
        self.names("objects", MAX_OBJECTS, &layout.objects)?;
        for (index, object) in objects.iter().enumerate() {
            let field = format!("objects[{index}].diameter_mm");
            self.positive(&[(&field, object.diameter_mm)])?;
        }
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
