//! Result files: estimated poses as comma-separated values.

use std::io::{self, Write};
use std::path::Path;

use csv::StringRecord;
use hicp_core::{Isometry3, RotationError};

use crate::atomic::write_atomically;
use crate::error::IoError;
use crate::pose::{pose_from_bop, pose_to_bop};
use crate::source::{read_bytes, text_bytes};

const COLUMNS: [&str; 7] = ["scene_id", "im_id", "obj_id", "score", "R", "t", "time"];

/// One estimate: an object in an image, and where it is.
///
/// The numbers of the pose are kept as they stood in the file, so that a row whose pose is not replaced is written back
/// with the same numbers, although its rotation may be orthogonal only up to rounding.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultRow {
    /// The scene.
    pub scene_id: u32,
    /// The image.
    pub im_id: u32,
    /// The object.
    pub obj_id: u32,
    /// Confidence; higher is better.
    pub score: f64,
    /// Seconds spent on all estimates of the image, where known.
    pub time_s: Option<f64>,
    rotation: [f64; 9],
    translation_mm: [f64; 3],
    camera_from_object: Isometry3<f64>,
}

impl ResultRow {
    /// Makes a row with score 1 and unknown time; the pose is in metres.
    #[must_use]
    pub fn new(scene_id: u32, im_id: u32, obj_id: u32, camera_from_object: Isometry3<f64>) -> Self {
        let (rotation, translation_mm) = pose_to_bop(&camera_from_object);
        Self {
            scene_id,
            im_id,
            obj_id,
            score: 1.0,
            time_s: None,
            rotation,
            translation_mm,
            camera_from_object,
        }
    }

    /// The estimate, metres; its rotation is the one nearest to the file's numbers.
    #[must_use]
    pub fn camera_from_object(&self) -> Isometry3<f64> {
        self.camera_from_object
    }

    /// Replaces the estimate; metres.
    pub fn set_camera_from_object(&mut self, camera_from_object: Isometry3<f64>) {
        (self.rotation, self.translation_mm) = pose_to_bop(&camera_from_object);
        self.camera_from_object = camera_from_object;
    }

    /// The rotation as it is written, row-major.
    #[must_use]
    pub fn rotation(&self) -> &[f64; 9] {
        &self.rotation
    }

    /// The translation as it is written, millimetres.
    #[must_use]
    pub fn translation_mm(&self) -> &[f64; 3] {
        &self.translation_mm
    }
}

/// Reads a result file, in its order.
///
/// Lenient in form: columns in any order and further ones, spaces, quotes, any line ending, blank lines, a byte order
/// mark. Strict in content: every number must be there and be finite, every rotation must be one up to rounding. A
/// negative time is unknown.
///
/// # Errors
///
/// [`IoError::CsvHeader`], [`IoError::CsvFields`], [`IoError::CsvValue`] naming line and column, [`IoError::Rotation`],
/// [`IoError::Read`].
pub fn read_results(path: impl AsRef<Path>) -> Result<Vec<ResultRow>, IoError> {
    let path = path.as_ref();
    let content = read_bytes(path)?;
    let text = text_bytes(path, &content)?;
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .flexible(true)
        .has_headers(false)
        .from_reader(text);
    let mut rows = Vec::new();
    let mut columns = None;
    for record in reader.records() {
        let record = record.map_err(|error| csv_error(path, text, error))?;
        if record.iter().all(str::is_empty) {
            continue;
        }
        match &columns {
            None => columns = Some((find_columns(path, &record)?, record.len())),
            Some((columns, count)) => {
                if record.len() != *count {
                    return Err(IoError::CsvFields {
                        path: path.to_owned(),
                        line: line_of(text, record.position()),
                        found: record.len(),
                        expected: *count,
                    });
                }
                let cells = Cells {
                    path,
                    text,
                    record: &record,
                    columns,
                };
                rows.push(cells.row()?);
            }
        }
    }
    match columns {
        Some(_) => Ok(rows),
        None => find_columns(path, &StringRecord::new()).map(|_| rows),
    }
}

/// Writes a result file, in the order of the rows, atomically. Every number is written so that it is read back exactly.
///
/// # Errors
///
/// As [`write_atomically`].
pub fn write_results(path: impl AsRef<Path>, rows: &[ResultRow]) -> Result<(), IoError> {
    write_atomically(path, |writer| {
        writeln!(writer, "{}", COLUMNS.join(","))?;
        for row in rows {
            write!(
                writer,
                "{},{},{},{},",
                row.scene_id, row.im_id, row.obj_id, row.score
            )?;
            write_numbers(writer, &row.rotation)?;
            write!(writer, ",")?;
            write_numbers(writer, &row.translation_mm)?;
            writeln!(writer, ",{}", row.time_s.unwrap_or(-1.0))?;
        }
        Ok(())
    })
}

fn write_numbers(writer: &mut dyn Write, numbers: &[f64]) -> io::Result<()> {
    for (index, number) in numbers.iter().enumerate() {
        let separator = if index == 0 { "" } else { " " };
        write!(writer, "{separator}{number}")?;
    }
    Ok(())
}

/// Returns where each of [`COLUMNS`] stands.
fn find_columns(path: &Path, header: &StringRecord) -> Result<[usize; 7], IoError> {
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
                    found: header.iter().collect::<Vec<_>>().join(","),
                });
            }
        }
    }
    Ok(places)
}

/// Returns the line of a record, from 1. The reader's own count is that of the blank lines before the record.
fn line_of(text: &[u8], position: Option<&csv::Position>) -> u64 {
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

fn csv_error(path: &Path, text: &[u8], error: csv::Error) -> IoError {
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
struct Cells<'a> {
    path: &'a Path,
    text: &'a [u8],
    record: &'a StringRecord,
    columns: &'a [usize; 7],
}

impl Cells<'_> {
    fn row(&self) -> Result<ResultRow, IoError> {
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
            found: self.cell(column).chars().take(60).collect(),
            expected,
        }
    }
}

fn parse_finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}
