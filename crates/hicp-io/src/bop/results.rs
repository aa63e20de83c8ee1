//! Result files: estimated poses as comma-separated values.

use std::fmt::{self, Write as _};
use std::path::Path;

use csv::StringRecord;
use hicp_core::Isometry3;

use super::result_cells::{COLUMNS, Cells, csv_error, find_columns, line_of};
use crate::atomic::write_atomically;
use crate::error::{IoError, Place};
use crate::json::not_finite;
use crate::limits::ReadLimits;
use crate::pose::pose_to_bop;
use crate::source::{Limited, read_bytes, text_bytes};

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
    pub(super) rotation: [f64; 9],
    pub(super) translation_mm: [f64; 3],
    pub(super) camera_from_object: Isometry3<f64>,
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
    ReadLimits::DEFAULT.read_results(path)
}

/// Reads the content of a result file; messages name `path`.
///
/// # Errors
///
/// As [`read_results`], but for [`IoError::Read`].
pub fn results_from_csv(content: &[u8], path: &Path) -> Result<Vec<ResultRow>, IoError> {
    parse_within(&ReadLimits::DEFAULT, content, path)
}

impl ReadLimits {
    /// As [`read_results`], within these limits.
    ///
    /// # Errors
    ///
    /// As [`read_results`].
    pub fn read_results(&self, path: impl AsRef<Path>) -> Result<Vec<ResultRow>, IoError> {
        let path = path.as_ref();
        parse_within(self, &read_bytes(path, self.max_file_bytes)?, path)
    }
}

fn parse_within(
    limits: &ReadLimits,
    content: &[u8],
    path: &Path,
) -> Result<Vec<ResultRow>, IoError> {
    let text = text_bytes(path, content)?;
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
                let count = rows.len() as u64;
                if count > limits.max_rows {
                    let line = usize::try_from(line_of(text, record.position()));
                    let place = Place::Line(line.unwrap_or(usize::MAX));
                    Limited::Rows.check(path, Some(place), count, limits.max_rows)?;
                }
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
/// As [`write_atomically`], and [`IoError::Write`] naming a number that is not finite, which no reader would take.
pub fn write_results(path: impl AsRef<Path>, rows: &[ResultRow]) -> Result<(), IoError> {
    write_atomically(path, |writer| {
        writeln!(writer, "{}", ResultRow::header())?;
        for (number, row) in (1_usize..).zip(rows) {
            if let Some(field) = row.not_finite() {
                return Err(not_finite(&format!("{field} of row {number}")));
            }
            writeln!(writer, "{row}")?;
        }
        Ok(())
    })
}

impl ResultRow {
    /// The first line of a result file, without its end.
    #[must_use]
    pub fn header() -> String {
        COLUMNS.join(",")
    }

    /// The column of a number that is not finite.
    fn not_finite(&self) -> Option<&'static str> {
        let fields = [
            ("score", std::slice::from_ref(&self.score)),
            ("R", &self.rotation),
            ("t", &self.translation_mm),
            ("time", self.time_s.as_slice()),
        ];
        let mut fields = fields.into_iter();
        fields.find_map(|(name, numbers)| numbers.iter().any(|x| !x.is_finite()).then_some(name))
    }
}

/// The row's line in a result file, without its end.
impl fmt::Display for ResultRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{},{},{},{},",
            self.scene_id, self.im_id, self.obj_id, self.score
        )?;
        write_numbers(f, &self.rotation)?;
        f.write_char(',')?;
        write_numbers(f, &self.translation_mm)?;
        write!(f, ",{}", self.time_s.unwrap_or(-1.0))
    }
}

fn write_numbers(f: &mut fmt::Formatter<'_>, numbers: &[f64]) -> fmt::Result {
    for (index, number) in numbers.iter().enumerate() {
        let separator = if index == 0 { "" } else { " " };
        write!(f, "{separator}{number}")?;
    }
    Ok(())
}
