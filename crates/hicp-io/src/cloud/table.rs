//! Point clouds as tables of numbers: text and NumPy arrays.

use super::points::{PointCloud, Points};
use crate::error::{IoError, Place, quote};
use crate::mesh::raw::Reading;

/// The names of the columns that are read.
const NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// Parses lines of numbers.
pub(super) fn parse_text(reading: Reading<'_>, text: &str) -> Result<PointCloud, IoError> {
    let lines = text.trim_start_matches('\u{feff}').lines().zip(1..);
    let lines = lines.filter(|(line, _)| !line.trim().is_empty());
    let separator = separator(lines.clone().map(|(line, _)| line));
    let mut rows_of_cells = lines.clone().filter(|(line, _)| !is_comment(line));
    let width = rows_of_cells.find_map(|(line, _)| {
        let cells = cells(line, separator);
        let numbers = cells.iter().filter(|cell| cell.parse::<f64>().is_ok());
        (numbers.count() > 2).then_some(cells.len())
    });
    let mut columns = [0, 1, 2, 3, 4, 5].map(Some);
    let mut named = false;
    let mut rows = Vec::new();
    for (line, number) in lines {
        let refuse = |found: String, expected: &str| {
            Err(reading.refuse(Place::Line(number), found, expected))
        };
        // The columns may have names, in a comment or not. PTS files start with a count.
        if rows.is_empty()
            && let Some(names) = header(line, separator)
            && width.is_none_or(|width| names.len() <= width)
        {
            let count = |wanted: &&&str| names.iter().filter(|name| name == *wanted).count();
            if let Some(twice) = NAMES.iter().find(|wanted| count(wanted) > 1) {
                return refuse(format!("two columns {}", quote(twice)), "one of each name");
            }
            columns = NAMES.map(|wanted| names.iter().position(|name| name == wanted));
            named = columns.iter().all(Option::is_some);
            continue;
        }
        let cells = cells(line, separator);
        if is_comment(line) || (rows.is_empty() && cells.len() == 1) {
            continue;
        }
        let mut row = [f64::NAN; 6];
        for (index, value) in row.iter_mut().enumerate() {
            let cell = columns[index].and_then(|column| cells.get(column));
            match cell.map(|cell| (cell, cell.parse())) {
                Some((_, Ok(number))) => *value = number,
                // Tables have nothing where nothing was measured.
                Some((&"", _)) => {}
                Some((cell, _)) if index < 3 || separator == Some(';') && cell.contains(',') => {
                    let found = format!("{} in the column {}", quote(cell), NAMES[index]);
                    return refuse(found, "a number such as 0.5");
                }
                None if index < 3 => {
                    let found = format!("{}, without a column {}", quote(line), NAMES[index]);
                    return refuse(found, "the coordinates of a point");
                }
                // Words after the coordinates may be of any kind.
                _ => {}
            }
        }
        rows.push((Place::Line(number), row));
    }
    collect(reading, &rows, named)
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with(['#', '/'])
}

/// Returns the cells of a line. Only white space, which is `None`, may be repeated.
fn cells(line: &str, separator: Option<char>) -> Vec<&str> {
    match separator {
        Some(separator) => line.split(separator).map(str::trim).collect(),
        None => line.split_whitespace().collect(),
    }
}

/// Returns the character between the cells of a table, or `None` for white space.
///
/// It is the one that splits the first lines into the most numbers, and then into rows of equal
/// length. A semicolon comes first, since the commas of such a table are those of its decimals.
fn separator<'a>(lines: impl Iterator<Item = &'a str>) -> Option<char> {
    let lines = lines.filter(|line| !is_comment(line)).take(20);
    let lines: Vec<&str> = lines.collect();
    let is_row = |line: &&str| line.matches(';').count() > 1 && header(line, Some(';')).is_none();
    if lines.iter().any(is_row) {
        return Some(';');
    }
    let fit = |separator: &Option<char>| {
        let rows: Vec<_> = lines.iter().map(|line| cells(line, *separator)).collect();
        let cells = rows.iter().flatten();
        let numbers = cells.filter(|cell| cell.parse::<f64>().is_ok()).count();
        (numbers, rows.iter().all(|row| row.len() == rows[0].len()))
    };
    // The last of several equal ones is taken.
    let separators = [Some('\t'), Some(','), None].into_iter();
    separators.max_by_key(fit).flatten()
}

/// Returns the names of the columns in lower case, if a line has those of the coordinates.
///
/// The header of a comment may have another separator than the numbers.
fn header(line: &str, separator: Option<char>) -> Option<Vec<String>> {
    let line = line.to_lowercase().replace('"', "");
    let line = match is_comment(&line) {
        true => line.trim_start_matches(|c: char| c.is_whitespace() || "#/".contains(c)),
        false => &line,
    };
    let words = line.split(|c: char| c.is_whitespace() || ",;".contains(c));
    let words = words.filter(|word| !word.is_empty()).collect();
    let mut splits = [cells(line, separator), words].into_iter();
    let names = splits.find(|names| NAMES[..3].iter().all(|name| names.contains(name)));
    names.map(|names| names.into_iter().map(str::to_owned).collect())
}

/// Parses an array whose last axis has the coordinates.
#[cfg(feature = "npy")]
pub(super) fn parse_npy(reading: Reading<'_>, content: &[u8]) -> Result<PointCloud, IoError> {
    let names = ["points", "xyz", "positions", "cloud", "arr_0"];
    let array = crate::npy::Array::parse(reading.limits, reading.path, content, &names)?;
    // A few rows or channels of many numbers are the coordinates of a transposed array.
    let columns = match &array.shape[..] {
        [axes @ .., columns] if *columns > 6 && axes.iter().any(|n| matches!(n, 3..=6)) => None,
        [_, .., columns] => Some(*columns),
        _ => None,
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
