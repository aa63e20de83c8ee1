//! The files of a report, and the page that contains them all.

use std::path::Path;

use hicp_io::{write_atomically, write_rgb_png};

use super::figure::Figure;
use super::html::{Table, page};
use super::tables::texts;
use crate::analysis::{Analysis, REPLICATES};
use crate::claims::Claim;
use crate::error::ExperimentError;
use crate::study::{Design, StudyOf};

/// A study in a report.
#[derive(Debug)]
pub struct Entry<D> {
    /// The name of the study, usually that of its folder.
    pub name: String,
    /// The study.
    pub study: StudyOf<D>,
    /// Its means and intervals.
    pub analysis: Analysis,
    /// The claims that were tested on it.
    pub claims: Vec<Claim>,
}

/// The parts of a report that depend on the kind of study.
#[derive(Debug)]
pub struct Document {
    /// Title of the page.
    pub title: &'static str,
    /// A note that explains the page, as HTML.
    pub note: String,
    /// Figures: name of the file, heading, figure.
    pub figures: Vec<(&'static str, &'static str, Figure)>,
    /// Results, as HTML.
    pub results: String,
    /// The paired differences.
    pub differences: Table,
    /// Other tables, with the names of their files.
    pub tables: Vec<(&'static str, Table)>,
}

/// A kind of study that has a report.
pub trait Reported: Design {
    /// Tests the claims about a study.
    fn claims(&self, analysis: &Analysis) -> Vec<Claim>;

    /// Returns names and values of the configuration, except for objects, seed and camera.
    fn described(&self) -> Vec<(&'static str, String)>;

    /// Describes the report of some studies.
    fn document(entries: &[Entry<Self>]) -> Document;
}

/// Returns a table with the rows of all studies, below column names separated by `|`.
pub(crate) fn table<D>(
    entries: &[Entry<D>],
    head: &str,
    rows: impl Fn(&Entry<D>) -> Vec<Vec<String>>,
) -> Table {
    Table {
        rows: entries.iter().flat_map(rows).collect(),
        ..Table::headed(head)
    }
}

/// Returns the part of the note that every report has, as HTML.
pub(crate) fn note_on_intervals() -> String {
    format!(
        "VSD is the mean over tolerances of 5 % to 50 % of the diameter, against the true pose of \
         the original model. Brackets show 95 % intervals: percentiles of {REPLICATES} bootstrap \
         samples over objects and, within each object, over cases (of a bin). Differences are paired."
    )
}

/// A report of analyzed studies.
#[derive(Debug)]
pub struct ReportOf<D> {
    entries: Vec<Entry<D>>,
}

impl<D: Reported> ReportOf<D> {
    /// Analyzes studies, each with a name, usually that of its folder.
    #[must_use]
    pub fn of(studies: Vec<(String, StudyOf<D>)>) -> Self {
        let entry = |(name, study): (String, StudyOf<D>)| {
            let analysis = Analysis::of(&study);
            Entry {
                name,
                claims: study.config.claims(&analysis),
                study,
                analysis,
            }
        };
        Self {
            entries: studies.into_iter().map(entry).collect(),
        }
    }

    /// Returns the studies.
    #[must_use]
    pub fn entries(&self) -> &[Entry<D>] {
        &self.entries
    }

    /// Returns the claims of all studies, with the names of the studies.
    pub fn claims(&self) -> impl Iterator<Item = (&str, &Claim)> {
        let entries = self.entries.iter();
        entries.flat_map(|entry| entry.claims.iter().map(|claim| (&*entry.name, claim)))
    }

    /// Returns the figures, with the names of their files.
    #[must_use]
    pub fn figures(&self) -> Vec<(&'static str, Figure)> {
        let figures = D::document(&self.entries).figures.into_iter();
        figures.map(|(name, _, figure)| (name, figure)).collect()
    }

    /// Writes `report.html`, which contains everything, and separate files.
    ///
    /// These are the tables as CSV files, the figures as SVG and PNG files, and the configurations
    /// of several studies as JSON files.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when a figure cannot be drawn or a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), ExperimentError> {
        std::fs::create_dir_all(folder).map_err(ExperimentError::folder(folder))?;
        let write = |name: &str, text: &str| {
            write_atomically(folder.join(name), |w| w.write_all(text.as_bytes()))
        };
        let mut document = D::document(&self.entries);
        document.figures.retain(|(_, _, figure)| !figure.is_empty());
        let mut figures = String::new();
        for (name, heading, figure) in &document.figures {
            write(&format!("{name}.svg"), &figure.svg()?)?;
            let (width, height, rgb) = figure.pixels()?;
            write_rgb_png(folder.join(format!("{name}.png")), width, height, &rgb)?;
            figures += &format!("<h2>{heading}</h2>\n{}", figure.html()?);
        }
        let claims = self.claims_table();
        write("claims.csv", &claims.csv())?;
        write("differences.csv", &document.differences.csv())?;
        for (name, table) in &document.tables {
            write(name, &table.csv())?;
        }
        // The configuration of a single study is usually in the same folder.
        for entry in self.entries.iter().filter(|_| self.entries.len() > 1) {
            let config = serde_json::to_string_pretty(&entry.study.config).unwrap_or_default();
            write(&format!("{}.json", entry.name), &(config + "\n"))?;
        }
        let section = |heading: &str, html: &str| format!("<h2>{heading}</h2>\n{html}");
        let unmade = Some(self.unmade()).filter(|table| !table.rows.is_empty());
        let unmade = unmade.map(|table| section("Cases that could not be created", &table.html()));
        let differences = format!(
            "<details><summary>All paired differences</summary>\n{}</details>\n",
            document.differences.html()
        );
        let body = [
            section("Configuration", &self.configurations().html()),
            format!("<p>{}</p>\n", document.note),
            section("Claims", &claims.html()),
            figures,
            document.results,
            unmade.unwrap_or_default(),
            section("Differences of the mean VSD, by group", &differences),
        ];
        write("report.html", &page(document.title, &body.concat()))?;
        Ok(())
    }

    /// Returns the configurations: a column per study, and a line per field.
    fn configurations(&self) -> Table {
        let mut table = Table::new(&["study"]);
        for (index, entry) in self.entries.iter().enumerate() {
            table.head.push(entry.name.clone());
            for (line, (name, value)) in entry.described().into_iter().enumerate() {
                if index == 0 {
                    table.rows.push(vec![name.to_owned()]);
                }
                table.rows[line].push(value);
            }
        }
        table
    }

    fn claims_table(&self) -> Table {
        let mut table = Table::new(&["study", "where", "claim", "verdict", "figures"]);
        table.rows.extend(self.claims().map(|(study, claim)| {
            let (section, verdict) = (claim.section, claim.verdict.words());
            texts(&[study, section, &claim.text, &verdict, &claim.figures])
        }));
        table
    }

    /// Returns the reasons why cases could not be created, once per case and reason.
    fn unmade(&self) -> Table {
        let mut table = Table::new(&["study", "object", "case", "reason"]);
        for entry in &self.entries {
            for row in entry.study.rows.iter().filter(|row| row.measured.is_none()) {
                let case = row.case.to_string();
                let why = texts(&[&entry.name, &row.object, &case, &row.note]);
                table.rows.push(why);
            }
        }
        table.rows.dedup();
        table
    }
}

impl<D: Reported> Entry<D> {
    fn described(&self) -> Vec<(&'static str, String)> {
        let layout = self.study.config.layout();
        let objects: Vec<&str> = layout.objects.iter().map(|o| o.name.as_str()).collect();
        let expected = layout.n_cases().saturating_mul(layout.rows_per_case());
        let rows = match self.study.rows.len() {
            rows if rows == expected => rows.to_string(),
            rows => format!("{rows} of {expected}: not finished"),
        };
        let ((width, height), fx) = (layout.camera.size(), layout.camera.fx());
        let mut all = vec![
            ("objects", objects.join(", ")),
            ("rows", rows),
            ("seed", layout.seed.to_string()),
            ("camera", format!("{width}×{height}, f = {fx:.1}")),
        ];
        all.extend(self.study.config.described());
        all
    }
}
