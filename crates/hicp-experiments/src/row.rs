//! The rows of a study: one per case, level and variant.

use std::path::Path;

use hicp_io::ReadLimits;

use crate::config::Config;
use crate::error::ExperimentError;
use crate::stored::{Order, Places, check_bin, count_in_order, each_record, measure, number, vsd};

/// The columns of `cases.csv`, in order.
pub const COLUMNS: [&str; 12] = [
    "object",
    "case",
    "variant",
    "level",
    "bin",
    "vsd_initial",
    "vsd_final",
    "add_final_mm",
    "iterations",
    "termination",
    "cpu_ms",
    "note",
];

/// The termination of a case that could not be made; `note` says why.
pub(crate) const NOT_MADE: &str = "not_made";

/// What one variant made of one case at one level.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Name of the object.
    pub object: String,
    /// Index of the case among those of its object.
    pub case: u64,
    /// Name of the variant.
    pub variant: String,
    /// The level; see [`crate::Experiment::levels`].
    pub level: String,
    /// Bin of `vsd_initial` of ten, from 0, where cases are binned.
    pub bin: Option<usize>,
    /// What was measured; `None` when the case could not be made.
    pub measured: Option<Measured>,
    /// Why the case could not be made; empty otherwise.
    pub note: String,
}

/// The figures of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Mean VSD of the initial pose against the truth, with the original model (§VI-A.2).
    pub vsd_initial: f64,
    /// Mean VSD of the returned pose.
    pub vsd_final: f64,
    /// ADD of the returned pose, or ADI (ADD-S) where the object declares symmetries, millimetres.
    pub add_final_mm: f64,
    /// Number of iterations, all stages together.
    pub iterations: usize,
    /// Why the last stage ended.
    pub termination: String,
    /// Processor time from depth image and mask to pose, milliseconds; `None` in a study without times.
    pub cpu_ms: Option<f64>,
}

impl Row {
    /// The fields in the order of [`COLUMNS`], numbers with a fixed number of digits.
    pub(crate) fn fields(&self) -> [String; 12] {
        let bin = self.bin.map_or_else(String::new, |b| b.to_string());
        let m = self.measured.as_ref();
        let number = |digits: usize, value: Option<f64>| {
            value.map_or_else(String::new, |x| format!("{x:.digits$}"))
        };
        [
            self.object.clone(),
            self.case.to_string(),
            self.variant.clone(),
            self.level.clone(),
            bin,
            number(6, m.map(|m| m.vsd_initial)),
            number(6, m.map(|m| m.vsd_final)),
            number(4, m.map(|m| m.add_final_mm)),
            m.map_or_else(String::new, |m| m.iterations.to_string()),
            m.map_or_else(|| NOT_MADE.to_owned(), |m| m.termination.clone()),
            number(3, m.and_then(|m| m.cpu_ms)),
            self.note.clone(),
        ]
    }

    /// Reads a row back; the error says which field is wrong.
    pub(crate) fn parse(record: &csv::StringRecord) -> Result<Self, String> {
        if record.len() != COLUMNS.len() {
            return Err(format!(
                "{} fields, expected {}",
                record.len(),
                COLUMNS.len()
            ));
        }
        let optional = |column: usize| Some(&record[column]).filter(|text| !text.is_empty());
        let measured = if &record[9] == NOT_MADE {
            None
        } else {
            Some(Measured {
                vsd_initial: vsd(COLUMNS[5], &record[5])?,
                vsd_final: vsd(COLUMNS[6], &record[6])?,
                add_final_mm: measure(COLUMNS[7], &record[7])?,
                iterations: number(COLUMNS[8], &record[8])?,
                termination: record[9].to_owned(),
                cpu_ms: optional(10)
                    .map(|text| measure(COLUMNS[10], text))
                    .transpose()?,
            })
        };
        Ok(Self {
            object: record[0].to_owned(),
            case: number(COLUMNS[1], &record[1])?,
            variant: record[2].to_owned(),
            level: record[3].to_owned(),
            bin: optional(4)
                .map(|text| number(COLUMNS[4], text))
                .transpose()?,
            measured,
            note: record[11].to_owned(),
        })
    }
}

/// Returns rows as CSV, without a header.
pub(crate) fn to_csv<'a>(rows: impl IntoIterator<Item = [String; 12]> + 'a) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        // A vector takes everything.
        let _ = writer.write_record(&row);
    }
    writer.into_inner().unwrap_or_default()
}

/// Returns the header line.
pub(crate) fn header() -> Vec<u8> {
    to_csv([COLUMNS.map(str::to_owned)])
}

/// Reads the rows of a study from a file.
pub(crate) fn read(
    limits: &ReadLimits,
    path: &Path,
    config: &Config,
) -> Result<Vec<Row>, ExperimentError> {
    let mut rows = Vec::new();
    let text = limits.read_text(path)?;
    each(limits, path, &text, config, |row, _| {
        rows.push(row);
        Ok(())
    })?;
    Ok(rows)
}

/// Counts the rows that a run is to go on with; others than the first ones of the study are refused.
pub(crate) fn count(
    limits: &ReadLimits,
    path: &Path,
    text: &str,
    config: &Config,
) -> Result<u64, ExperimentError> {
    let mut rows = 0;
    each(limits, path, text, config, |_, place| {
        count_in_order(&mut rows, place)
    })?;
    Ok(rows)
}

/// Reads the rows of a study from the text of a file; those that the study cannot have are refused.
fn each(
    limits: &ReadLimits,
    path: &Path,
    text: &str,
    config: &Config,
    mut take: impl FnMut(Row, u64) -> Result<(), String>,
) -> Result<(), ExperimentError> {
    let columns = [
        ("object", config.objects.iter().map(|o| &*o.name).collect()),
        ("level", config.levels.iter().map(|l| &**l).collect()),
        (
            "variant",
            config.variants.iter().map(|v| &*v.name).collect(),
        ),
    ];
    let mut places = Places::new(columns, ("case", config.poses), Order::Objects);
    let levels = 0..config.levels.len();
    let binned: Vec<bool> = levels
        .map(|level| config.experiment.condition(level, 0).binned)
        .collect();
    let bins = config.bins.max(1) as u64;
    each_record(path, text, &header(), limits.max_rows, |record| {
        let row = Row::parse(record)?;
        let ([_, level, _], place) =
            places.take([&row.object, &row.level, &row.variant], row.case)?;
        let bin = usize::try_from(row.case % bins).ok();
        let bin = bin.filter(|_| binned.get(level) == Some(&true));
        check_bin(row.bin, bin, row.measured.is_some())?;
        take(row, place)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        Row {
            object: "mug, red".to_owned(),
            case: 12,
            variant: "hybrid".to_owned(),
            level: "0".to_owned(),
            bin: Some(2),
            measured: Some(Measured {
                vsd_initial: 0.25,
                vsd_final: 0.0625,
                add_final_mm: 1.5,
                iterations: 31,
                termination: "converged".to_owned(),
                cpu_ms: None,
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
            let text = to_csv([row.fields()]);
            let mut reader = csv::ReaderBuilder::new()
                .has_headers(false)
                .from_reader(&text[..]);
            let record = reader.records().next().unwrap().unwrap();
            assert_eq!(Row::parse(&record), Ok(row));
        }
    }

    #[test]
    fn a_wrong_field_is_named() {
        let mut fields = row().fields();
        fields[6] = "NaN".to_owned();
        let told = Row::parse(&csv::StringRecord::from(fields.to_vec())).unwrap_err();
        assert!(told.contains("vsd_final") && told.contains("NaN"), "{told}");
    }
}
