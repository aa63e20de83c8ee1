//! A stored study, read and checked.

use std::path::Path;

use hicp_io::{IoError, Place, ReadLimits};

use super::design::Design;
use super::fields::Fields;
use super::row::{Mismatch, Row, quoted};
use crate::error::ExperimentError;

/// Name of the file of the configuration.
pub const CONFIG_FILE: &str = "config.json";

/// A study that was run, completely or in part: its configuration and its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyOf<D> {
    /// The configuration.
    pub config: D,
    /// The rows, in the order of the file.
    pub rows: Vec<Row>,
}

impl<D: Design> StudyOf<D> {
    /// Reads a study, finished or not, from its folder.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when a file is missing, exceeds the default limits, or does not come
    /// from [`run`](crate::run). Also if no row is finished. It states the field of the
    /// configuration or the line of the rows.
    pub fn read(folder: &Path) -> Result<Self, ExperimentError> {
        Self::read_within(&ReadLimits::DEFAULT, folder)
    }

    /// Reads a study from its folder, within custom limits.
    ///
    /// # Errors
    ///
    /// The same as those of [`StudyOf::read`].
    pub fn read_within(limits: &ReadLimits, folder: &Path) -> Result<Self, ExperimentError> {
        let config: D = read_config(limits, &folder.join(CONFIG_FILE))?;
        let path = folder.join(D::ROWS_FILE);
        let rows = parse_rows(&config, limits, &path, &limits.read_text(&path)?)?;
        if rows.iter().all(|row| row.measured.is_none()) {
            return Err(IoError::new(path, None, "no finished row", "at least one").into());
        }
        Ok(Self { config, rows })
    }
}

/// Reads and checks a configuration.
pub(crate) fn read_config<D: Design>(limits: &ReadLimits, path: &Path) -> Result<D, IoError> {
    let text = limits.read_small_json_text(path)?;
    let config: D = serde_json::from_str(&text).map_err(|error| {
        IoError::new(
            path,
            None,
            error.to_string(),
            "the configuration of a study",
        )
    })?;
    config.check(&Fields::of(path, &config))?;
    Ok(config)
}

/// Parses a file of rows, which must be the first rows of a run, in the order of the run.
pub(crate) fn parse_rows<D: Design>(
    config: &D,
    limits: &ReadLimits,
    path: &Path,
    text: &str,
) -> Result<Vec<Row>, IoError> {
    let wrong =
        |line, (found, expected): Mismatch| IoError::new(path, Place::Line(line), found, expected);
    let header = format!("{}\n", D::COLUMNS);
    let Some(lines) = text.strip_prefix(&header) else {
        let found = quoted(text.split('\n').next().unwrap_or_default());
        let expected = format!("the columns {}", D::COLUMNS);
        return Err(wrong(1, (found, expected)));
    };
    let layout = config.layout();
    let mut rows = Vec::new();
    // `Row::read` checks the number of fields.
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader.flexible(true).has_headers(false);
    for record in reader.from_reader(lines.as_bytes()).records() {
        // Reading text that is in memory cannot fail.
        let record = record.unwrap_or_default();
        let line = record
            .position()
            .map_or(1, |place| number(place.line()) + 1);
        limits.check_rows(path, line, rows.len() as u64 + 1)?;
        let place = layout.row(rows.len()).filter(|_| line == rows.len() + 2);
        let Some(place) = place else {
            let most = layout.n_cases().saturating_mul(layout.rows_per_case());
            let expected = format!("at most {most}, each on one line");
            return Err(wrong(line, ("another row".to_owned(), expected)));
        };
        let row = place.read(D::COLUMNS, &record);
        rows.push(row.map_err(|mismatch| wrong(line, mismatch))?);
    }
    Ok(rows)
}

/// Converts the number of a line, which is below the number of bytes in memory.
fn number(line: u64) -> usize {
    usize::try_from(line).unwrap_or(usize::MAX)
}
