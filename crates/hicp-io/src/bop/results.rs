//! Result files: estimated poses as comma-separated values.

use std::path::Path;

use csv::StringRecord;
use hicp_core::RotationError;

use super::result_row::{COLUMNS, ResultRow};
use crate::atomic::write_atomically;
use crate::error::{IoError, Place, quote};
use crate::json::not_finite;
use crate::limits::ReadLimits;
use crate::pose::pose_from_bop;
use crate::source::text_bytes;

/// Reads a result file, in the order of its rows.
///
/// The form may vary. Columns may be in any order, and other columns are ignored. Spaces, quotes,
/// blank lines, a byte order mark and any line ending are accepted.
///
/// The content must be complete. Every number must be present and finite. Every rotation must be
/// orthogonal up to rounding. A negative time means unknown.
///
/// # Errors
///
/// [`IoError`] names the line and the column.
pub fn read_results(path: impl AsRef<Path>) -> Result<Vec<ResultRow>, IoError> {
    ReadLimits::DEFAULT.read_results(path)
}

/// Parses the content of a result file. Error messages name `path`.
///
/// # Errors
///
/// As for [`read_results`].
pub fn results_from_csv(content: &[u8], path: &Path) -> Result<Vec<ResultRow>, IoError> {
    parse(&ReadLimits::DEFAULT, path, content)
}

impl ReadLimits {
    /// Reads a file as [`read_results`] does, within these limits.
    ///
    /// # Errors
    ///
    /// As for [`read_results`].
    pub fn read_results(&self, path: impl AsRef<Path>) -> Result<Vec<ResultRow>, IoError> {
        let path = path.as_ref();
        parse(self, path, &self.read_bytes(path)?)
    }
}

/// Writes a result file atomically, in the order of `rows`. Every number is read back exactly.
///
/// # Errors
///
/// As for [`write_atomically`]; also if a number is not finite, which the source of the error
/// names.
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
            let is_bad = |(_, numbers): &&(_, &[f64])| numbers.iter().any(|x| !x.is_finite());
            if let Some((name, _)) = numbers.iter().find(is_bad) {
                return Err(not_finite(&format!("{name} of row {number}")));
            }
            writeln!(writer, "{row}")?;
        }
        Ok(())
    })
}

fn parse(limits: &ReadLimits, path: &Path, content: &[u8]) -> Result<Vec<ResultRow>, IoError> {
    let text = text_bytes(path, content)?;
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .flexible(true)
        .has_headers(false)
        .from_reader(text);
    let (mut rows, mut header) = (Vec::new(), None);
    for record in reader.records() {
        // Rows may have any length and reading from memory cannot fail, so only the encoding can be
        // wrong.
        let record = record.map_err(|error| {
            let place = Place::Line(line_of(text, error.position()));
            let expected = "comma-separated values in UTF-8";
            IoError::new(path, place, "bytes that are not UTF-8", expected)
        })?;
        if record.iter().all(str::is_empty) {
            continue;
        }
        let Some((columns, fields)) = &header else {
            header = Some((columns_of(path, &record)?, record.len()));
            continue;
        };
        let line = || line_of(text, record.position());
        if record.len() != *fields {
            let found = format!("{} fields", record.len());
            let expected = format!("{fields} as in the header");
            return Err(IoError::new(path, Place::Line(line()), found, expected));
        }
        let cells = columns.map(|column| record.get(column).unwrap_or_default());
        let row = row_of(&cells).map_err(|(column, source)| {
            let (name, expected) = COLUMNS[column];
            let place = Place::Field(format!("line {}, column {name:?}", line()));
            let error = IoError::new(path, place, quote(cells[column]), expected);
            match source {
                None => error,
                Some(source) => error.with_source(source),
            }
        });
        rows.push(row?);
        if rows.len() as u64 > limits.max_rows {
            limits.check_rows(path, line(), rows.len() as u64)?;
        }
    }
    if header.is_none() {
        columns_of(path, &StringRecord::new())?;
    }
    Ok(rows)
}

/// Returns the position of each of [`COLUMNS`] in the header.
fn columns_of(path: &Path, header: &StringRecord) -> Result<[usize; 7], IoError> {
    let mut columns = [0; 7];
    for (column, (name, _)) in columns.iter_mut().zip(COLUMNS) {
        let names = header.iter().enumerate();
        let found: Vec<_> = names.filter(|(_, found)| *found == name).collect();
        let [(index, _)] = found[..] else {
            let text = quote(&header.iter().collect::<Vec<_>>().join(","));
            let times = found.len();
            let found = match header.is_empty() {
                true => "no header".to_owned(),
                false => format!("a header in which column {name:?} appears {times} times: {text}"),
            };
            let expected = format!("the columns {}, separated by commas", ResultRow::header());
            return Err(IoError::new(path, Place::Line(1), found, expected));
        };
        *column = index;
    }
    Ok(columns)
}

/// Parses the cells of [`COLUMNS`].
///
/// The error is the index of the invalid column, and the reason if its numbers are not a rotation.
fn row_of(cells: &[&str; 7]) -> Result<ResultRow, (usize, Option<RotationError>)> {
    let integer = |column: usize| cells[column].parse().map_err(|_| (column, None));
    let [score] = numbers(cells[3]).ok_or((3, None))?;
    let rotation = numbers(cells[4]).ok_or((4, None))?;
    let translation_mm = numbers(cells[5]).ok_or((5, None))?;
    let [time] = numbers(cells[6]).ok_or((6, None))?;
    let pose = pose_from_bop(&rotation, &translation_mm);
    Ok(ResultRow {
        scene_id: integer(0)?,
        im_id: integer(1)?,
        obj_id: integer(2)?,
        score,
        time_s: (time >= 0.0).then_some(time),
        rotation,
        translation_mm,
        camera_from_object: pose.map_err(|error| (4, Some(error)))?,
    })
}

/// Returns the line number of a record, from 1.
///
/// The reader reports a position before the blank lines that precede the record.
fn line_of(text: &[u8], position: Option<&csv::Position>) -> usize {
    let start = position.map_or(0, |position| position.byte());
    let start = usize::try_from(start).unwrap_or_else(|_| unreachable!("the text is in memory"));
    let (before, rest) = text.split_at(start);
    let blank = rest.iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
    let end = if text.contains(&b'\n') { b'\n' } else { b'\r' };
    let bytes = before.iter().chain(blank);
    1 + bytes.filter(|byte| **byte == end).count()
}

/// Parses N finite numbers separated by spaces.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let words = text.split_whitespace();
    let numbers = words.map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()));
    numbers.collect::<Option<Vec<_>>>()?.try_into().ok()
}
