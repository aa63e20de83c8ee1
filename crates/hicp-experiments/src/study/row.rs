//! The rows of a study, and how they are written and read.

/// The result of one variant for one case in one setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Name of the object.
    pub object: String,
    /// Index of the case, or of the trajectory, among those of its object.
    pub case: u64,
    /// The setting: a level of the experiment, or the pipeline underlying a sequential estimator.
    pub setting: String,
    /// The variant: a pipeline, or a method that fuses estimates.
    pub variant: String,
    /// Bin of the initial VSD, from 0, where cases are binned.
    pub bin: Option<usize>,
    /// The figures; `None` if the case could not be made.
    pub measured: Option<Measured>,
    /// Why the case could not be made; empty otherwise.
    pub note: String,
}

/// The figures of a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Mean VSD of the initial pose against the truth, with the original model (§VI-A.2).
    pub vsd_initial: f64,
    /// Mean VSD of the returned pose; along a trajectory, of the fused pose where the path ends.
    pub vsd_final: f64,
    /// ADD of that pose, or ADI (ADD-S) if the object declares symmetries, millimeters.
    pub add_final_mm: f64,
    /// Number of iterations of all stages, or of estimates along a trajectory.
    pub steps: usize,
    /// Why the last stage ended; empty for a trajectory.
    pub termination: String,
    /// Processor time from depth image and mask to pose, milliseconds; `None` if not measured.
    pub cpu_ms: Option<f64>,
    /// ξᵀΣ⁻¹ξ of the fused pose's error by the covariance that the method states.
    ///
    /// Distributed like χ²₆ if that covariance is right. `None` without an estimate, and for an
    /// object with a continuous symmetry.
    pub mahalanobis_squared: Option<f64>,
}

/// The figures of a row, or why there are none.
pub type Outcome = Result<Measured, String>;

/// The part of a row that a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields of `Row` and `Measured`")]
pub enum Column {
    Object,
    Case,
    Setting,
    Variant,
    Bin,
    VsdInitial,
    VsdFinal,
    AddFinalMm,
    Steps,
    Termination,
    CpuMs,
    MahalanobisSquared,
    Note,
}

/// The columns of a file of rows, in order, with their names.
pub type Columns = [(&'static str, Column)];

/// The termination of a case that could not be made.
const NOT_MADE: &str = "not_made";
/// Most characters of a value that a message shows.
const SHOWN: usize = 60;

impl Row {
    /// Returns rows as CSV, one per line, without a header. Numbers have a fixed number of digits.
    pub(crate) fn to_csv(columns: &Columns, rows: &[Self]) -> String {
        let fields =
            |row: &Self| -> Vec<String> { columns.iter().map(|c| row.field(c.1)).collect() };
        to_csv(rows.iter().map(fields))
    }

    fn field(&self, column: Column) -> String {
        let measured = self.measured.as_ref();
        let number =
            |digits: usize, value: fn(&Measured) -> Option<f64>| match measured.and_then(value) {
                Some(x) => format!("{x:.digits$}"),
                None => String::new(),
            };
        let count = |count: Option<usize>| count.map_or_else(String::new, |n| n.to_string());
        match column {
            Column::Object => self.object.clone(),
            Column::Case => self.case.to_string(),
            Column::Setting => self.setting.clone(),
            Column::Variant => self.variant.clone(),
            Column::Bin => count(self.bin),
            Column::VsdInitial => number(6, |m| Some(m.vsd_initial)),
            Column::VsdFinal => number(6, |m| Some(m.vsd_final)),
            Column::AddFinalMm => number(4, |m| Some(m.add_final_mm)),
            Column::Steps => count(measured.map(|m| m.steps)),
            Column::Termination => measured.map_or(NOT_MADE, |m| &m.termination).to_owned(),
            Column::CpuMs => number(3, |m| m.cpu_ms),
            Column::MahalanobisSquared => number(4, |m| m.mahalanobis_squared),
            Column::Note => self.note.replace(['\n', '\r'], " "),
        }
    }

    /// Reads a row; the error names the wrong column.
    pub(crate) fn parse(columns: &Columns, record: &csv::StringRecord) -> Result<Self, String> {
        if record.len() != columns.len() {
            let (found, expected) = (record.len(), columns.len());
            return Err(format!("{found} fields, expected {expected}"));
        }
        let fields = Record { columns, record };
        let text = |column| fields.get(column).1;
        let is_made = match text(Column::Termination) {
            "" => !text(Column::Steps).is_empty(),
            termination => termination != NOT_MADE,
        };
        let vsd = |column| fields.number(column, |x| (0.0..=1.0).contains(x), " from 0 to 1");
        let measure = |column| {
            let is_valid = |x: &f64| x.is_finite() && *x >= 0.0;
            fields.number(column, is_valid, " of at least 0")
        };
        let optional = |column| match text(column) {
            "" => Ok(None),
            _ => measure(column).map(Some),
        };
        let measured = || -> Result<Measured, String> {
            Ok(Measured {
                vsd_initial: vsd(Column::VsdInitial)?,
                vsd_final: vsd(Column::VsdFinal)?,
                add_final_mm: measure(Column::AddFinalMm)?,
                steps: fields.number(Column::Steps, |_| true, "")?,
                termination: text(Column::Termination).to_owned(),
                cpu_ms: optional(Column::CpuMs)?,
                mahalanobis_squared: optional(Column::MahalanobisSquared)?,
            })
        };
        Ok(Self {
            object: text(Column::Object).to_owned(),
            case: fields.number(Column::Case, |_| true, "")?,
            setting: text(Column::Setting).to_owned(),
            variant: text(Column::Variant).to_owned(),
            bin: match text(Column::Bin) {
                "" => None,
                _ => Some(fields.number(Column::Bin, |_| true, "")?),
            },
            measured: is_made.then(measured).transpose()?,
            note: text(Column::Note).to_owned(),
        })
    }
}

/// Returns the header line of a file of rows.
pub(crate) fn header(columns: &Columns) -> String {
    to_csv([columns.iter().map(|column| column.0)])
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

/// Returns a text in quotes, shortened so that a broken file does not fill the screen.
pub(crate) fn quoted(text: &str) -> String {
    let shown: String = text.chars().take(SHOWN).collect();
    let more = if shown.len() < text.len() { "..." } else { "" };
    format!("{shown:?}{more}")
}

/// A record whose fields are found by their columns.
#[derive(Clone, Copy)]
struct Record<'a> {
    columns: &'a Columns,
    record: &'a csv::StringRecord,
}

impl<'a> Record<'a> {
    /// Returns the name and the text of a column; two empty texts if the file has no such column.
    fn get(self, column: Column) -> (&'static str, &'a str) {
        let mut fields = self.columns.iter().zip(self.record);
        let field = fields.find(|(c, _)| c.1 == column);
        field.map_or(("", ""), |(column, text)| (column.0, text))
    }

    /// Parses a number; `range` continues the message "expected a number".
    fn number<T: std::str::FromStr>(
        self,
        column: Column,
        is_valid: fn(&T) -> bool,
        range: &str,
    ) -> Result<T, String> {
        let (name, text) = self.get(column);
        let value = text.parse().ok().filter(is_valid);
        value.ok_or_else(|| format!("{name} is {}, expected a number{range}", quoted(text)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: &Columns = <crate::Config as crate::Design>::COLUMNS;

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
            let record = reader.records().next().unwrap().unwrap();
            assert_eq!(Row::parse(COLUMNS, &record), Ok(row));
        }
    }

    #[test]
    fn a_wrong_field_is_named() {
        let mut fields: Vec<String> = COLUMNS.iter().map(|c| row().field(c.1)).collect();
        fields[6] = "NaN".to_owned();
        let told = Row::parse(COLUMNS, &csv::StringRecord::from(fields)).unwrap_err();
        assert!(told.contains("vsd_final") && told.contains("NaN"), "{told}");
    }
}
