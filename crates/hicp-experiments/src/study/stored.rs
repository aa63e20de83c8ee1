//! A study as it is stored, read back and checked.

use std::path::Path;

use hicp_io::ReadLimits;

use super::design::Design;
use super::fields::Fields;
use super::layout::Places;
use super::row::{Row, header, quoted};
use crate::error::ExperimentError;

/// Name of the file of the configuration.
pub const CONFIG_FILE: &str = "config.json";

/// A study that has been run, completely or not: its configuration and its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyOf<D> {
    /// The configuration.
    pub config: D,
    /// The rows, in the order of the file.
    pub rows: Vec<Row>,
}

impl<D: Design> StudyOf<D> {
    /// Reads a study from its folder; it may be unfinished.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when a file is missing, exceeds the default limits, or is not what
    /// [`run`](crate::run) wrote: the field of the configuration or the line of the rows is named.
    pub fn read(folder: &Path) -> Result<Self, ExperimentError> {
        Self::read_within(&ReadLimits::DEFAULT, folder)
    }

    /// Reads a study from its folder, within custom limits.
    ///
    /// # Errors
    ///
    /// As [`StudyOf::read`].
    pub fn read_within(limits: &ReadLimits, folder: &Path) -> Result<Self, ExperimentError> {
        let config: D = read_config(limits, &folder.join(CONFIG_FILE))?;
        let path = folder.join(D::ROWS_FILE);
        let mut rows = Vec::new();
        let text = limits.read_text(&path)?;
        each_row(&config, limits, &path, &text, |row, _| {
            rows.push(row);
            Ok(())
        })?;
        if rows.iter().all(|row| row.measured.is_none()) {
            return Err(ExperimentError::Empty { path });
        }
        Ok(Self { config, rows })
    }
}

/// Reads and checks a configuration.
pub(crate) fn read_config<D: Design>(
    limits: &ReadLimits,
    path: &Path,
) -> Result<D, ExperimentError> {
    let text = limits.read_small_json_text(path)?;
    let config: D =
        serde_json::from_str(&text).map_err(|source| ExperimentError::Configuration {
            path: path.to_owned(),
            source,
        })?;
    config.check(Fields::of(path))?;
    Ok(config)
}

/// Calls `each` with every row in the text of a file, and with the number of rows that a run writes
/// before it.
///
/// Refuses rows that the study cannot have, with the line.
pub(crate) fn each_row<D: Design>(
    config: &D,
    limits: &ReadLimits,
    path: &Path,
    text: &str,
    mut each: impl FnMut(Row, u64) -> Result<(), String>,
) -> Result<(), ExperimentError> {
    let wrong = |line: u64, what: String| ExperimentError::Row {
        path: path.to_owned(),
        line: usize::try_from(line).unwrap_or(usize::MAX),
        what,
    };
    let header = header(D::COLUMNS);
    if !text.starts_with(&header) {
        let found = quoted(text.split('\n').next().unwrap_or_default());
        let what = format!("found {found}, expected the columns {}", header.trim_end());
        return Err(wrong(1, what));
    }
    let mut places = Places::new(config.layout(), D::COLUMNS);
    // `Row::parse` checks the number of fields.
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .from_reader(text.as_bytes());
    for (record, rows) in reader.records().zip(1..) {
        let record = record.map_err(|error| {
            wrong(
                error.position().map_or(1, csv::Position::line),
                error.to_string(),
            )
        })?;
        let line = record.position().map_or(1, csv::Position::line);
        limits.check_rows(path, usize::try_from(line).unwrap_or(usize::MAX), rows)?;
        let row = Row::parse(D::COLUMNS, &record).map_err(|what| wrong(line, what))?;
        let place = places.take(&row).map_err(|what| wrong(line, what))?;
        each(row, place).map_err(|what| wrong(line, what))?;
    }
    Ok(())
}

/// Refuses rows that are not the first ones of a study, those of so many cases.
///
/// A run keeps what is there, and continues after it.
pub(crate) fn check_order<D: Design>(
    config: &D,
    limits: &ReadLimits,
    path: &Path,
    text: &str,
    cases: usize,
) -> Result<(), ExperimentError> {
    let mut rows = 0;
    each_row(config, limits, path, text, |_, place| {
        rows += 1;
        match place + 1 {
            found if found == rows => Ok(()),
            found => Err(format!(
                "found row {found} of the study, expected row {rows}: a run goes on only after rows in the order in which it writes them"
            )),
        }
    })?;
    match cases.saturating_mul(config.layout().rows_per_case()) as u64 {
        expected if expected == rows => Ok(()),
        expected => Err(ExperimentError::Row {
            path: path.to_owned(),
            line: text.lines().count(),
            what: format!("found {rows} rows up to here, expected {expected}: one per line"),
        }),
    }
}
