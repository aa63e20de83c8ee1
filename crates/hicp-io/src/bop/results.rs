//! Result files: estimated poses as comma-separated values.

use std::path::Path;

use csv::StringRecord;

use super::result_row::{COLUMNS, ResultRow};
use crate::atomic::write_atomically;
use crate::error::{IoError, Place, quote};
use crate::json::not_finite;
use crate::limits::ReadLimits;
use crate::pose::pose_from_bop;
use crate::source::text_bytes;

/// Reads a result file, in its order.
///
/// Lenient in form: columns in any order and further ones, spaces, quotes, any line ending, blank lines, a byte order
/// mark. Strict in content: every number must be there and be finite, every rotation must be one up to rounding. A
/// negative time is unknown.
///
/// # Errors
///
/// [`IoError`] that names line and column.
pub fn read_results(path: impl AsRef<Path>) -> Result<Vec<ResultRow>, IoError> {
    ReadLimits::DEFAULT.read_results(path)
}

/// Reads the content of a result file; messages name `path`.
///
/// # Errors
///
/// As [`read_results`].
pub fn results_from_csv(content: &[u8], path: &Path) -> Result<Vec<ResultRow>, IoError> {
    Table::new(path, content)?.rows(&ReadLimits::DEFAULT)
}

impl ReadLimits {
    /// As [`read_results`], within these limits.
    ///
    /// # Errors
    ///
    /// As [`read_results`].
    pub fn read_results(&self, path: impl AsRef<Path>) -> Result<Vec<ResultRow>, IoError> {
        let path = path.as_ref();
        Table::new(path, &self.read_bytes(path)?)?.rows(self)
    }
}

/// Writes a result file, in the order of the rows, atomically. Every number is written so that it is read back exactly.
///
/// # Errors
///
/// As [`write_atomically`]; also if a number is not finite, which the source names.
pub fn write_results(path: impl AsRef<Path>, rows: &[ResultRow]) -> Result<(), IoError> {
    write_atomically(path, |writer| {
        writeln!(writer, "{}", ResultRow::header())?;
        for (number, row) in (1_usize..).zip(rows) {
            let numbers: [(&str, &[f64]); 4] = [
                ("score", &[row.score]),
                ("R", &row.rotation),
                ("t", &row.translation_mm),
                ("time", row.time_s.as_slice()),
            ];
            if let Some((name, _)) = numbers
                .iter()
                .find(|(_, n)| !n.iter().all(|x| x.is_finite()))
            {
                return Err(not_finite(&format!("{name} of row {number}")));
            }
            writeln!(writer, "{row}")?;
        }
        Ok(())
    })
}

/// The text of a result file.
struct Table<'a> {
    path: &'a Path,
    text: &'a [u8],
}

impl<'a> Table<'a> {
    fn new(path: &'a Path, content: &'a [u8]) -> Result<Self, IoError> {
        let text = text_bytes(path, content)?;
        Ok(Self { path, text })
    }

    fn rows(&self, limits: &ReadLimits) -> Result<Vec<ResultRow>, IoError> {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .flexible(true)
            .has_headers(false)
            .from_reader(self.text);
        let mut rows = Vec::new();
        let mut header = None;
        for record in reader.records() {
            // Rows of any length and bytes in memory leave one possible error.
            let record = record.map_err(|error| {
                let line = self.line_of(error.position());
                self.refuse(
                    line,
                    "bytes that are not UTF-8",
                    "comma-separated values in UTF-8",
                )
            })?;
            if record.iter().all(str::is_empty) {
                continue;
            }
            let line = || self.line_of(record.position());
            let Some((columns, fields)) = &header else {
                header = Some((self.columns(&record)?, record.len()));
                continue;
            };
            if record.len() != *fields {
                let found = format!("{} fields", record.len());
                return Err(self.refuse(line(), found, format!("{fields} as in the header")));
            }
            rows.push(self.row(&record, columns)?);
            if rows.len() as u64 > limits.max_rows {
                limits.check_rows(self.path, line(), rows.len() as u64)?;
            }
        }
        if header.is_none() {
            self.columns(&StringRecord::new())?;
        }
        Ok(rows)
    }

    /// Returns the index of each of [`COLUMNS`].
    fn columns(&self, header: &StringRecord) -> Result<[usize; 7], IoError> {
        let mut columns = [0; 7];
        for (column, (name, _)) in columns.iter_mut().zip(COLUMNS) {
            *column = header
                .iter()
                .position(|found| found == name)
                .unwrap_or_default();
            let times = header.iter().filter(|found| *found == name).count();
            if times != 1 {
                let text = quote(&header.iter().collect::<Vec<_>>().join(","));
                let found =
                    format!("a header in which column {name:?} appears {times} times: {text}");
                return Err(self.refuse(1, found, "it once"));
            }
        }
        Ok(columns)
    }

    fn row(&self, record: &StringRecord, columns: &[usize; 7]) -> Result<ResultRow, IoError> {
        let cell = |column: usize| record.get(columns[column]).unwrap_or_default();
        let refuse = |column: usize| {
            let (name, expected) = COLUMNS[column];
            let line = self.line_of(record.position());
            let place = Place::Field(format!("line {line}, column {name:?}"));
            IoError::new(self.path, place, quote(cell(column)), expected)
        };
        let integer = |column| cell(column).parse().map_err(|_| refuse(column));
        let number = |column| {
            numbers(cell(column))
                .map(|[x]| x)
                .ok_or_else(|| refuse(column))
        };
        let rotation = numbers(cell(4)).ok_or_else(|| refuse(4))?;
        let translation_mm = numbers(cell(5)).ok_or_else(|| refuse(5))?;
        let camera_from_object = pose_from_bop(&rotation, &translation_mm)
            .map_err(|error| refuse(4).with_source(error))?;
        let time = number(6)?;
        Ok(ResultRow {
            scene_id: integer(0)?,
            im_id: integer(1)?,
            obj_id: integer(2)?,
            score: number(3)?,
            time_s: (time >= 0.0).then_some(time),
            rotation,
            translation_mm,
            camera_from_object,
        })
    }

    fn refuse(
        &self,
        line: usize,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> IoError {
        IoError::new(self.path, Place::Line(line), found, expected)
    }

    /// Returns the line of a record, from 1. The position of the reader is in front of the blank lines before the record.
    fn line_of(&self, position: Option<&csv::Position>) -> usize {
        let start = position.map_or(0, |position| position.byte());
        let (before, rest) = self.text.split_at(usize::try_from(start).unwrap_or(0));
        let blank = rest.iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
        let end_of_line = if self.text.contains(&b'\n') {
            b'\n'
        } else {
            b'\r'
        };
        1 + before
            .iter()
            .chain(blank)
            .filter(|byte| **byte == end_of_line)
            .count()
    }
}

/// Parses N finite numbers separated by spaces.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers = text
        .split_whitespace()
        .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()));
    let numbers: Option<Vec<f64>> = numbers.collect();
    numbers?.try_into().ok()
}
