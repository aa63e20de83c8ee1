//! The cells of a result file's rows: numbers, or errors that name line and column.

use std::path::Path;

use csv::StringRecord;
use hicp_core::RotationError;

use super::results::ResultRow;
use crate::error::IoError;
use crate::pose::pose_from_bop;

/// The columns of a result file, in the order in which they are written.
pub(super) const COLUMNS: [&str; 7] = ["scene_id", "im_id", "obj_id", "score", "R", "t", "time"];

/// Returns where each of [`COLUMNS`] stands.
pub(super) fn find_columns(path: &Path, header: &StringRecord) -> Result<[usize; 7], IoError> {
    let mut places = [0; 7];
    for (place, column) in places.iter_mut().zip(COLUMNS) {
        let mut found = header
            .iter()
            .enumerate()
            .filter(|(_, name)| *name == column);
        match (found.next(), found.count()) {
            (Some((index, _)), 0) => *place = index,
            (first, others) => {
                return Err(IoError::CsvHeader {
                    path: path.to_owned(),
                    column,
                    times: others + usize::from(first.is_some()),
                    found: shortened(&header.iter().collect::<Vec<_>>().join(",")),
                });
            }
        }
    }
    Ok(places)
}

/// Returns the line of a record, from 1. The reader's own count is that of the blank lines before the record.
pub(super) fn line_of(text: &[u8], position: Option<&csv::Position>) -> u64 {
    let start = position.map_or(0, csv::Position::byte);
    let (before, rest) = text.split_at(usize::try_from(start).unwrap_or(0).min(text.len()));
    let blank = rest.iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
    let end_of_line = if text.contains(&b'\n') { b'\n' } else { b'\r' };
    let ends = before
        .iter()
        .chain(blank)
        .filter(|byte| **byte == end_of_line);
    1 + ends.count() as u64
}

pub(super) fn csv_error(path: &Path, text: &[u8], error: csv::Error) -> IoError {
    let line = line_of(text, error.position());
    match error.into_kind() {
        csv::ErrorKind::Io(source) => IoError::read(path, source),
        // With flexible rows and text records nothing else is left but bytes that are not UTF-8.
        _ => IoError::Line {
            path: path.to_owned(),
            line: usize::try_from(line).unwrap_or(0),
            found: "bytes that are not UTF-8".to_owned(),
            expected: "comma-separated values in UTF-8".to_owned(),
        },
    }
}

/// One row of text.
pub(super) struct Cells<'a> {
    pub(super) path: &'a Path,
    pub(super) text: &'a [u8],
    pub(super) record: &'a StringRecord,
    pub(super) columns: &'a [usize; 7],
}

impl Cells<'_> {
    pub(super) fn row(&self) -> Result<ResultRow, IoError> {
        let rotation = self.numbers(4, "9 finite numbers separated by spaces")?;
        let translation_mm = self.numbers(5, "3 finite numbers separated by spaces")?;
        let time: f64 = self.number(6, "a finite number of seconds, -1 if unknown")?;
        let camera_from_object =
            pose_from_bop(&rotation, &translation_mm).map_err(|source: RotationError| {
                IoError::Rotation {
                    path: self.path.to_owned(),
                    place: format!("line {}, column \"R\"", self.line()),
                    source,
                }
            })?;
        Ok(ResultRow {
            scene_id: self.integer(0)?,
            im_id: self.integer(1)?,
            obj_id: self.integer(2)?,
            score: self.number(3, "a finite number")?,
            time_s: (time >= 0.0).then_some(time),
            rotation,
            translation_mm,
            camera_from_object,
        })
    }

    fn line(&self) -> u64 {
        line_of(self.text, self.record.position())
    }

    fn cell(&self, column: usize) -> &str {
        self.record.get(self.columns[column]).unwrap_or_default()
    }

    fn integer(&self, column: usize) -> Result<u32, IoError> {
        let expected = "an integer from 0 to 4294967295";
        self.cell(column)
            .parse()
            .map_err(|_| self.refuse(column, expected))
    }

    fn number(&self, column: usize, expected: &'static str) -> Result<f64, IoError> {
        parse_finite(self.cell(column)).ok_or_else(|| self.refuse(column, expected))
    }

    fn numbers<const N: usize>(
        &self,
        column: usize,
        expected: &'static str,
    ) -> Result<[f64; N], IoError> {
        let numbers: Option<Vec<f64>> = self
            .cell(column)
            .split_whitespace()
            .map(parse_finite)
            .collect();
        numbers
            .and_then(|numbers| numbers.try_into().ok())
            .ok_or_else(|| self.refuse(column, expected))
    }

    fn refuse(&self, column: usize, expected: &'static str) -> IoError {
        IoError::CsvValue {
            path: self.path.to_owned(),
            line: self.line(),
            column: COLUMNS[column],
            found: shortened(self.cell(column)),
            expected,
        }
    }
}

/// What an error shows of a text that it quotes: a broken file must not fill the screen.
fn shortened(text: &str) -> String {
    text.chars().take(90).collect()
}

fn parse_finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}
