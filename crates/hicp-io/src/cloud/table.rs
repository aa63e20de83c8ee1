//! Point clouds as tables of numbers: text and NumPy arrays.

use super::points::{PointCloud, Points};
use crate::error::{IoError, Place, quote};
use crate::mesh::raw::Reading;

/// The names of the columns that are read.
const NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// Parses lines of numbers.
pub(super) fn parse_text(reading: Reading<'_>, text: &str) -> Result<PointCloud, IoError> {
    let is_separator = |c: char| c.is_whitespace() || ",;".contains(c);
    let lines = text.trim_start_matches('\u{feff}').lines().zip(1..);
    let lines = lines.map(|(line, number)| (line.trim(), number));
    let mut columns: Option<[Option<usize>; 6]> = None;
    let mut rows = Vec::new();
    for (line, number) in lines.filter(|(line, _)| !line.is_empty()) {
        let words = line.trim_start_matches(['#', '/']).split(is_separator);
        let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
        // The columns may have names, in a comment or not. PTS files start with a count.
        let names: Vec<String> = words.iter().map(|word| word.to_lowercase()).collect();
        if rows.is_empty() && names.iter().any(|name| name == "x") {
            columns = Some(NAMES.map(|wanted| names.iter().position(|name| name == wanted)));
            continue;
        }
        if line.starts_with(['#', '/']) || (rows.is_empty() && words.len() == 1) {
            continue;
        }
        let columns = columns.unwrap_or([0, 1, 2, 3, 4, 5].map(Some));
        let values = columns.map(|column| match column.and_then(|column| words.get(column)) {
            Some(word) => word.parse().ok(),
            None => Some(f64::NAN),
        });
        let [Some(_), Some(_), Some(_), ..] = values else {
            let place = Place::Line(number);
            return Err(reading.refuse(place, quote(line), "the coordinates of a point"));
        };
        // Words after the coordinates may be of any kind.
        rows.push((
            Place::Line(number),
            values.map(|value| value.unwrap_or(f64::NAN)),
        ));
    }
    let named = columns.is_some_and(|columns| columns[3..].iter().all(Option::is_some));
    collect(reading, &rows, named)
}

/// Parses an array whose last axis has the coordinates.
#[cfg(feature = "npy")]
pub(super) fn parse_npy(reading: Reading<'_>, content: &[u8]) -> Result<PointCloud, IoError> {
    let names = ["points", "xyz", "positions", "cloud", "arr_0"];
    let array = crate::npy::Array::parse(reading.limits, reading.path, content, &names)?;
    // A few rows of many numbers are the coordinates of a transposed array.
    let columns = match array.shape[..] {
        [3..=6, 7..=usize::MAX] | [] | [_] => None,
        [.., columns] => Some(columns),
    };
    let Some(columns @ 3..) = columns else {
        let found = format!("an array of the shape {:?}", array.shape);
        return Err(reading.refuse(
            Place::Byte(0),
            found,
            "the shape (points, 3) or (points, 6)",
        ));
    };
    let numbers: Vec<f64> = array.numbers().collect();
    let rows = numbers.chunks_exact(columns).map(|row| {
        let mut values = [f64::NAN; 6];
        values
            .iter_mut()
            .zip(row)
            .for_each(|(value, number)| *value = *number);
        (Place::Byte(0), values)
    });
    let cloud = collect(reading, &rows.collect::<Vec<_>>(), false)?;
    Ok(cloud.organized(array.shape.len() > 2))
}

/// Collects the rows. Columns 4 to 6 are normals if they are named so, or all have length 1.
fn collect(
    reading: Reading<'_>,
    rows: &[(Place, [f64; 6])],
    named: bool,
) -> Result<PointCloud, IoError> {
    let is_unit = |[.., x, y, z]: &[f64; 6]| (x * x + y * y + z * z - 1.0).abs() < 1e-2;
    let measured = || {
        rows.iter()
            .filter(|(_, row)| row[..3].iter().all(|x| x.is_finite()))
    };
    let normals = named || measured().all(|(_, row)| is_unit(row));
    let mut points = Points::new(reading);
    for (place, row) in rows {
        let mut row = *row;
        if !normals {
            row[3..].fill(f64::NAN);
        }
        points.add(place.clone(), &row)?;
    }
    points.finish()
}
