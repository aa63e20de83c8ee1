//! The files of a study on their way back in: what no run could have written is refused.

use std::collections::{HashMap, HashSet};
use std::ops::RangeInclusive;
use std::path::Path;

use hicp_core::PinholeCamera;
use hicp_io::{IoError, Place, ReadLimits};
use serde::de::DeserializeOwned;

use crate::config::{CameraRecord, ObjectRecord};
use crate::error::ExperimentError;

/// Most bins of the initial VSD in a study; the paper has ten.
pub const MAX_BINS: usize = 1000;
/// Most objects of a study.
pub const MAX_OBJECTS: usize = 10_000;
/// Most levels times variants times bins of a study: its analysis holds about 128 kB for each of these cells.
pub const MAX_CELLS: usize = 10_000;

/// Most characters of a value that a message shows.
const SHOWN: usize = 60;
/// Most names that a message lists.
const LISTED: usize = 12;

/// Returns a text in quotes, shortened so that a broken file does not fill the screen.
pub(crate) fn quoted(text: &str) -> String {
    let shown: String = text.chars().take(SHOWN).collect();
    match shown.len() < text.len() {
        true => format!("{shown:?}..."),
        false => format!("{shown:?}"),
    }
}

/// Reads a configuration, which is yet to be checked.
pub(crate) fn read_json<T: DeserializeOwned>(
    limits: &ReadLimits,
    path: &Path,
) -> Result<T, ExperimentError> {
    let text = limits.read_small_json_text(path)?;
    serde_json::from_str(&text).map_err(|source| ExperimentError::Configuration {
        path: path.to_owned(),
        source,
    })
}

/// Checks the fields of a configuration.
#[derive(Clone, Copy)]
pub(crate) struct Fields<'a> {
    /// The file that the configuration is from, or is to be written to.
    pub(crate) path: &'a Path,
}

impl Fields<'_> {
    /// Says what is wrong with a field.
    pub(crate) fn wrong(
        self,
        field: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> ExperimentError {
        ExperimentError::Field {
            path: self.path.to_owned(),
            field: field.into(),
            found: found.into(),
            expected: expected.into(),
        }
    }

    /// Refuses a count out of its range.
    pub(crate) fn count(
        self,
        field: &str,
        count: u64,
        range: RangeInclusive<u64>,
    ) -> Result<(), ExperimentError> {
        if range.contains(&count) {
            return Ok(());
        }
        let expected = format!("{} to {}", range.start(), range.end());
        Err(self.wrong(field, count.to_string(), expected))
    }

    /// Refuses numbers that are not finite or below 0.
    pub(crate) fn not_negative(self, numbers: &[(&str, f64)]) -> Result<(), ExperimentError> {
        let wrong = |(_, x): &&(&str, f64)| !(x.is_finite() && *x >= 0.0);
        match numbers.iter().find(wrong) {
            None => Ok(()),
            Some((field, x)) => Err(self.wrong(*field, format!("{x:?}"), "a number of at least 0")),
        }
    }

    /// Refuses numbers that are not finite and above 0.
    pub(crate) fn positive(self, numbers: &[(&str, f64)]) -> Result<(), ExperimentError> {
        let wrong = |(_, x): &&(&str, f64)| !(x.is_finite() && *x > 0.0);
        match numbers.iter().find(wrong) {
            None => Ok(()),
            Some((field, x)) => Err(self.wrong(*field, format!("{x:?}"), "a number above 0")),
        }
    }

    /// Refuses no names, too many, and two that are the same.
    pub(crate) fn names<'n>(
        self,
        field: &str,
        most: usize,
        names: impl ExactSizeIterator<Item = &'n str>,
    ) -> Result<(), ExperimentError> {
        if !(1..=most).contains(&names.len()) {
            let found = match names.len() {
                0 => "none".to_owned(),
                n => n.to_string(),
            };
            return Err(self.wrong(field, found, format!("1 to {most}")));
        }
        let mut seen = HashSet::new();
        for name in names {
            if !seen.insert(name) {
                let found = format!("{} twice", quoted(name));
                return Err(self.wrong(field, found, "different names"));
            }
        }
        Ok(())
    }

    /// Refuses a camera that none is.
    pub(crate) fn camera(self, camera: &CameraRecord) -> Result<(), ExperimentError> {
        let c = camera;
        match PinholeCamera::new(c.fx, c.fy, c.cx, c.cy, c.width, c.height) {
            Ok(_) => Ok(()),
            Err(error) => Err(self.wrong(
                "camera",
                format!("numbers that are none ({error})"),
                "a camera",
            )),
        }
    }

    /// Refuses objects without names of their own or a size.
    pub(crate) fn objects(self, objects: &[ObjectRecord]) -> Result<(), ExperimentError> {
        let names = objects.iter().map(|o| o.name.as_str());
        self.names("objects", MAX_OBJECTS, names)?;
        for (index, object) in objects.iter().enumerate() {
            let field = format!("objects[{index}].diameter_mm");
            self.positive(&[(&field, object.diameter_mm)])?;
        }
        Ok(())
    }

    /// Refuses a study whose analysis would not fit into memory; the counts and what they are of.
    pub(crate) fn cells(self, counts: [(&str, usize); 3]) -> Result<(), ExperimentError> {
        let cells = counts
            .iter()
            .try_fold(1_usize, |product, (_, n)| product.checked_mul(*n));
        if cells.is_some_and(|cells| cells <= MAX_CELLS) {
            return Ok(());
        }
        Err(self.wrong(
            counts.map(|(name, _)| name).join(" × "),
            counts.map(|(_, n)| n.to_string()).join(" × "),
            format!("at most {MAX_CELLS}"),
        ))
    }
}

/// Calls `each` with every record of a file of rows; what it says is wrong is told with the line.
pub(crate) fn each_record(
    path: &Path,
    text: &str,
    header: &[u8],
    max_rows: u64,
    mut each: impl FnMut(&csv::StringRecord) -> Result<(), String>,
) -> Result<(), ExperimentError> {
    let wrong = |line: u64, what: String| ExperimentError::Row {
        path: path.to_owned(),
        line: usize::try_from(line).unwrap_or(usize::MAX),
        what,
    };
    if !text.as_bytes().starts_with(header) {
        let first = text.split('\n').next().unwrap_or_default();
        let columns = String::from_utf8_lossy(header);
        let what = format!(
            "found {}, expected the columns {}",
            quoted(first),
            columns.trim_end()
        );
        return Err(wrong(1, what));
    }
    // Each says itself how many fields it expects.
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .from_reader(text.as_bytes());
    let mut record = csv::StringRecord::new();
    let mut rows = 0;
    loop {
        match reader.read_record(&mut record) {
            Ok(true) => {}
            Ok(false) => return Ok(()),
            Err(error) => {
                let line = error.position().map_or(1, csv::Position::line);
                return Err(wrong(line, error.to_string()));
            }
        }
        let line = record.position().map_or(1, csv::Position::line);
        rows += 1;
        if rows > max_rows {
            return Err(ExperimentError::Io(IoError::Limit {
                path: path.to_owned(),
                place: usize::try_from(line).ok().map(Place::Line),
                what: "rows",
                count: rows,
                limit: max_rows,
                field: "max_rows",
            }));
        }
        each(&record).map_err(|what| wrong(line, what))?;
    }
}

/// The names that a column of a file of rows may hold, in the order of the configuration.
struct Names<'a> {
    column: &'static str,
    listed: Vec<&'a str>,
    places: HashMap<&'a str, usize>,
}

impl Names<'_> {
    fn place(&self, name: &str) -> Result<usize, String> {
        self.places.get(name).copied().ok_or_else(|| {
            let listed: Vec<String> = self.listed.iter().take(LISTED).map(|n| quoted(n)).collect();
            let more = if self.listed.len() > LISTED {
                ", ..."
            } else {
                ""
            };
            format!(
                "{} is {}, expected one of config.json: {}{more}",
                self.column,
                quoted(name),
                listed.join(", ")
            )
        })
    }
}

/// The rows that a configuration has, each of which may be there once: an object, two more names and the index of a case.
pub(crate) struct Places<'a> {
    names: [Names<'a>; 3],
    case: &'static str,
    cases: u64,
    order: Order,
    seen: HashSet<u64>,
}

/// What a run goes through first.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// All cases of an object, then those of the next.
    Objects,
    /// A case of every object, then the next of every object.
    Cases,
}

impl<'a> Places<'a> {
    /// The columns with the names that they may hold, objects first; the column of the index and the number of cases of an object.
    pub(crate) fn new(
        columns: [(&'static str, Vec<&'a str>); 3],
        (case, cases): (&'static str, u64),
        order: Order,
    ) -> Self {
        let names = columns.map(|(column, listed)| Names {
            column,
            places: listed.iter().enumerate().map(|(i, n)| (*n, i)).collect(),
            listed,
        });
        Self {
            names,
            case,
            cases,
            order,
            seen: HashSet::new(),
        }
    }

    /// Takes a row that is not there yet; returns the indices of its names, and how many rows a run writes before it.
    pub(crate) fn take(
        &mut self,
        names: [&str; 3],
        case: u64,
    ) -> Result<([usize; 3], u64), String> {
        let mut places = [0; 3];
        for ((place, column), name) in places.iter_mut().zip(&self.names).zip(names) {
            *place = column.place(name)?;
        }
        if case >= self.cases {
            return Err(format!(
                "{} is {case}, expected less than {}, the number in config.json",
                self.case, self.cases
            ));
        }
        // The limits on a configuration keep these far below the largest number.
        let [object, second, third] = places.map(|place| place as u64);
        let number = |index: usize| self.names[index].listed.len() as u64;
        let unit = match self.order {
            Order::Objects => object * self.cases + case,
            Order::Cases => case * number(0) + object,
        };
        let row = (unit * number(1) + second) * number(2) + third;
        if !self.seen.insert(row) {
            let told = [0, 1, 2].map(|i| format!("{} {}", self.names[i].column, quoted(names[i])));
            return Err(format!(
                "found {}, {} {case} again, expected every row once",
                told.join(", "),
                self.case
            ));
        }
        Ok((places, row))
    }
}

/// Counts the rows of a file that a run is to go on with: they are to be the first ones of the study, without a gap.
pub(crate) fn count_in_order(count: &mut u64, row: u64) -> Result<(), String> {
    if row != *count {
        return Err(format!(
            "found row {} of the study, expected row {}: a run goes on only after rows in the order in which it writes them",
            row + 1,
            *count + 1
        ));
    }
    *count += 1;
    Ok(())
}

/// Refuses a bin other than that of the case; a row without figures need not state it.
pub(crate) fn check_bin(
    found: Option<usize>,
    expected: Option<usize>,
    measured: bool,
) -> Result<(), String> {
    if found == expected || (found.is_none() && !measured) {
        return Ok(());
    }
    let told = |bin: Option<usize>| bin.map_or_else(|| "empty".to_owned(), |bin| bin.to_string());
    Err(format!(
        "bin is {}, expected {}: cases go through the bins of config.json in turn",
        told(found),
        told(expected)
    ))
}

/// Reads a field as a number.
pub(crate) fn number<T: std::str::FromStr>(column: &str, text: &str) -> Result<T, String> {
    text.parse()
        .map_err(|_| format!("{column} is {}, expected a number", quoted(text)))
}

/// Reads a field as a finite number of at least 0.
pub(crate) fn measure(column: &str, text: &str) -> Result<f64, String> {
    let value: f64 = number(column, text)?;
    if value.is_finite() && value >= 0.0 {
        return Ok(value);
    }
    Err(format!(
        "{column} is {}, expected a number of at least 0",
        quoted(text)
    ))
}

/// Reads a field as a mean VSD.
pub(crate) fn vsd(column: &str, text: &str) -> Result<f64, String> {
    let value: f64 = number(column, text)?;
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    Err(format!(
        "{column} is {}, expected a number from 0 to 1",
        quoted(text)
    ))
}
