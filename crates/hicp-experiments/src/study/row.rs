//! The rows of a study, written to and read from CSV.

use std::collections::HashMap;
use std::str::FromStr;

/// The result of one variant for one case in one setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Name of the object.
    pub object: String,
    /// Index of the case, or of the trajectory, among those of its object.
    pub case: u64,
    /// The setting: a level of the experiment, or the underlying pipeline of a sequential study.
    pub setting: String,
    /// The variant: a pipeline, or a method that fuses estimates.
    pub variant: String,
    /// Bin of the initial VSD, from 0. `None` if cases are not binned, or if the case could not be
    /// created.
    pub bin: Option<usize>,
    /// The figures; `None` if the case could not be created.
    pub measured: Option<Measured>,
    /// The reason why the case could not be created; otherwise empty.
    pub note: String,
}

/// The figures of a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Mean VSD of the initial pose against the truth, with the original model (§VI-A.2).
    pub vsd_initial: f64,
    /// Mean VSD of the returned pose. For a trajectory, of the fused pose at the end of the path.
    pub vsd_final: f64,
    /// ADD of that pose, or ADI (ADD-S) if the object declares symmetries, millimeters.
    pub add_final_mm: f64,
    /// Number of iterations of all stages, or of estimates along a trajectory.
    pub steps: usize,
    /// The reason why the last stage ended; empty for a trajectory.
    pub termination: String,
    /// Processor time from depth image and mask to pose, milliseconds; `None` if not measured.
    pub cpu_ms: Option<f64>,
    /// The choices of the switcher, one letter per outer iteration: `a` for aligned, `m` for
    /// misaligned. Empty if the variant does not switch.
    pub regimes: String,
    /// ξᵀΣ⁻¹ξ of the error of the fused pose, with the covariance that the method states.
    ///
    /// If that covariance is right, it is distributed like χ²₆. `None` without an estimate, and for
    /// an object with a continuous symmetry.
    pub mahalanobis_squared: Option<f64>,
}

/// The figures of a row, or the reason why there are none.
pub type Outcome = Result<Measured, String>;

/// The columns that identify a row. A study has one of two names for some of them.
const PLACE: [&str; 8] = [
    "object",
    "case",
    "trajectory",
    "level",
    "underlying",
    "variant",
    "method",
    "bin",
];
/// The termination of a case that could not be created.
const NOT_MADE: &str = "not_made";
/// Largest number of characters of a value in a message.
const SHOWN: usize = 60;

/// The value that was found in a line, and the one that was expected.
pub(crate) type Mismatch = (String, String);

impl Row {
    /// Adds the figures to a row, or the reason why there are none.
    pub(crate) fn with(self, outcome: Outcome) -> Self {
        Self {
            bin: self.bin.filter(|_| outcome.is_ok()),
            note: outcome.as_ref().err().cloned().unwrap_or_default(),
            measured: outcome.ok(),
            ..self
        }
    }

    /// Returns rows as CSV, one per line, without a header. Numbers have a fixed number of digits.
    pub(crate) fn to_csv(columns: &str, rows: &[Self]) -> String {
        let fields = |row: &Self| columns.split(',').map(|column| row.field(column)).collect();
        to_csv(rows.iter().map(fields).collect::<Vec<Vec<_>>>())
    }

    fn field(&self, column: &str) -> String {
        let measured = self.measured.as_ref();
        let number = |digits: usize, value: fn(&Measured) -> Option<f64>| {
            let value = measured.and_then(value);
            value.map_or_else(String::new, |x| format!("{x:.digits$}"))
        };
        let count = |count: Option<usize>| count.map_or_else(String::new, |n| n.to_string());
        match column {
            "object" => self.object.clone(),
            "case" | "trajectory" => self.case.to_string(),
            "level" | "underlying" => self.setting.clone(),
            "variant" | "method" => self.variant.clone(),
            "bin" => count(self.bin),
            "vsd_initial" => number(6, |m| Some(m.vsd_initial)),
            "vsd_final" => number(6, |m| Some(m.vsd_final)),
            "add_final_mm" => number(4, |m| Some(m.add_final_mm)),
            "iterations" | "n_estimates" => count(measured.map(|m| m.steps)),
            "termination" => measured.map_or(NOT_MADE, |m| &m.termination).to_owned(),
            "cpu_ms" => number(3, |m| m.cpu_ms),
            "regimes" => measured.map_or_else(String::new, |m| m.regimes.clone()),
            "mahalanobis_squared" => number(4, |m| m.mahalanobis_squared),
            "note" => self.note.replace(['\n', '\r'], " "),
            other => unreachable!("no study has the column {other}"),
        }
    }

    /// Reads the figures of this row from a line, and checks the other fields.
    pub(crate) fn read(self, columns: &str, line: &csv::StringRecord) -> Result<Self, Mismatch> {
        let names = columns.split(',');
        let expected = names.clone().count();
        if line.len() != expected {
            return Err((format!("{} fields", line.len()), expected.to_string()));
        }
        let line = Line(names.zip(line).collect());
        let is_made = match line.text("termination") {
            "" => !line.text("iterations").is_empty() || !line.text("n_estimates").is_empty(),
            termination => termination != NOT_MADE,
        };
        let row = self.with(match is_made {
            true => Ok(line.measured()?),
            false => Err(line.text("note").to_owned()),
        });
        for name in PLACE.into_iter().filter(|name| line.0.contains_key(name)) {
            let (found, expected) = (line.text(name), row.field(name));
            if found != expected {
                let (found, expected) = (quoted(found), quoted(&expected));
                let why = "by config.json and the order in which a run writes rows";
                return Err((format!("{name} {found}"), format!("{expected}, {why}")));
            }
        }
        Ok(row)
    }
}

/// Returns records as CSV.
pub(crate) fn to_csv<R>(records: impl IntoIterator<Item = R>) -> String
where
    R: IntoIterator<Item: AsRef<[u8]>>,
{
    let mut writer = csv::Writer::from_writer(Vec::new());
    for record in records {
        // Writing to a vector cannot fail, and all records have the same length.
        let _ = writer.write_record(record);
    }
    String::from_utf8(writer.into_inner().unwrap_or_default()).unwrap_or_default()
}

/// Returns a text in quotes, shortened so that a damaged file does not fill the screen.
pub(crate) fn quoted(text: &str) -> String {
    let shown: String = text.chars().take(SHOWN).collect();
    let more = if shown.len() < text.len() { "..." } else { "" };
    format!("{shown:?}{more}")
}

/// The fields of a line by column.
struct Line<'a>(HashMap<&'a str, &'a str>);

impl<'a> Line<'a> {
    /// Returns the text of a column. If there is no such column, it is empty.
    fn text(&self, column: &str) -> &'a str {
        self.0.get(column).copied().unwrap_or_default()
    }

    fn measured(&self) -> Result<Measured, Mismatch> {
        let share = |x: &f64| (0.0..=1.0).contains(x);
        let share = |column| self.number(column, share, "a number from 0 to 1");
        let positive = |x: &f64| x.is_finite() && *x >= 0.0;
        let positive = |column| self.number(column, positive, "a number of at least 0");
        let optional = |column| match self.text(column) {
            "" => Ok(None),
            _ => positive(column).map(Some),
        };
        let steps = match self.0.contains_key("iterations") {
            true => "iterations",
            false => "n_estimates",
        };
        Ok(Measured {
            vsd_initial: share("vsd_initial")?,
            vsd_final: share("vsd_final")?,
            add_final_mm: positive("add_final_mm")?,
            steps: self.number(steps, |_| true, "a number")?,
            termination: self.text("termination").to_owned(),
            cpu_ms: optional("cpu_ms")?,
            regimes: self.text("regimes").to_owned(),
            mahalanobis_squared: optional("mahalanobis_squared")?,
        })
    }

    fn number<T: FromStr>(
        &self,
        column: &str,
        is_valid: fn(&T) -> bool,
        expected: &str,
    ) -> Result<T, Mismatch> {
        let text = self.text(column);
        let value = text.parse().ok().filter(is_valid);
        value.ok_or_else(|| (format!("{column} {}", quoted(text)), expected.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: &str = <crate::Config as crate::Design>::COLUMNS;

    fn row() -> Row {
        Row {
            object: "mug, red".to_owned(),
            case: 12,
            variant: "hybrid".to_owned(),
            setting: "0".to_owned(),
            bin: Some(2),
            measured: Some(Measured {
                vsd_initial: 0.25,
                vsd_final: 0.0625,
                add_final_mm: 1.5,
                steps: 31,
                termination: "converged".to_owned(),
                regimes: "ma".to_owned(),
                ..Measured::default()
            }),
            note: String::new(),
        }
    }

    #[test]
    fn rows_read_back() {
        let unmade = Row {
            bin: None,
            measured: None,
            note: "bin 9 \"of 10\"".to_owned(),
            ..row()
        };
        for row in [row(), unmade] {
            let text = Row::to_csv(COLUMNS, std::slice::from_ref(&row));
            let mut reader = csv::ReaderBuilder::new()
                .has_headers(false)
                .from_reader(text.as_bytes());
            let line = reader.records().next().unwrap().unwrap();
            let place = Row {
                bin: Some(2),
                measured: None,
                note: String::new(),
                ..row.clone()
            };
            assert_eq!(place.read(COLUMNS, &line), Ok(row));
        }
    }

    #[test]
    fn a_wrong_field_is_named() {
        let mut fields: Vec<String> = COLUMNS.split(',').map(|c| row().field(c)).collect();
        fields[6] = "NaN".to_owned();
        let (found, _) = row()
            .read(COLUMNS, &csv::StringRecord::from(fields))
            .unwrap_err();
        assert_eq!(found, "vsd_final \"NaN\"");
    }
}
