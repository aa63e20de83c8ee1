//! Files that no run wrote are refused, with their path and the field or the line.
//!
//! Nothing panics or allocates without limit.

mod configurations;
mod rows;

use hicp_experiments::{
    Analysis, CONFIG_FILE, Config, Design, Experiment, ExperimentError, FusionRule, HIGH, LOW,
    MAX_BINS, MAX_CELLS, MAX_OBJECTS, Metric, Report, ReportOf, Reported, RunOptions, Study,
    StudyOf, TrajectoryConfig, TrajectoryStudy, Variant, run,
};
use hicp_io::{IoError, IoErrorKind, Place, ReadLimits};
use hybrid_icp::Preset;
use serde_json::{Value, json};
use std::ops::{ControlFlow, Deref};
use std::path::Path;

use crate::common::{Folder, assert_contains, refused, subjects};

/// A folder with the two files of a study.
struct Stored {
    folder: Folder,
    rows: &'static str,
}

impl Stored {
    /// Creates a study of two objects, two cases, two bins and two variants.
    fn single() -> Self {
        let presets = [Preset::Hybrid, Preset::NnPointToPoint].map(Variant::preset);
        let mut config = Config::new(Experiment::InitNoise, &subjects(), &presets, 2, 3).unwrap();
        config.bins = 2;
        let mut text = format!("{}\n", Config::COLUMNS);
        for object in ["mug", "book"] {
            for case in 0..2 {
                for variant in ["hybrid", "nn-point-to-point"] {
                    text += &format!(
                        "{object},{case},{variant},0,{case},0.{case}5,0.04,1.5,9,converged,2.5,,\n"
                    );
                }
            }
        }
        Self::of(&config, &text)
    }

    /// Creates a sequential study of two objects and one trajectory per bin.
    fn sequential() -> Self {
        let presets = [Preset::Hybrid, Preset::ProjectiveCascadePointPlane];
        let mut config = TrajectoryConfig::new(&subjects(), &presets, 1, 3).unwrap();
        config.methods.truncate(2);
        let mut text = format!("{}\n", TrajectoryConfig::COLUMNS);
        for trajectory in 0..3 {
            for object in ["mug", "book"] {
                for underlying in presets {
                    for method in &config.methods {
                        text += &format!(
                            "{object},{trajectory},{trajectory},{underlying},{method},0.{trajectory}5,0.04,1.5,2,3.5,\n"
                        );
                    }
                }
            }
        }
        Self::of(&config, &text)
    }

    fn of<D: Design>(config: &D, rows: &str) -> Self {
        let folder = Folder::new();
        let config = serde_json::to_string_pretty(config).unwrap() + "\n";
        folder.write(CONFIG_FILE, config);
        folder.write(D::ROWS_FILE, rows);
        Self {
            folder,
            rows: D::ROWS_FILE,
        }
    }

    /// Reads the study and analyzes it like a report.
    fn read(&self) -> Result<usize, ExperimentError> {
        if self.rows == Config::ROWS_FILE {
            Self::analyzed::<Config>(self.root())
        } else {
            Self::analyzed::<TrajectoryConfig>(self.root())
        }
    }

    fn analyzed<D: Reported>(folder: &Path) -> Result<usize, ExperimentError> {
        let study = StudyOf::<D>::read(folder)?;
        let rows = study.rows.len();
        let report = ReportOf::of(vec![("it".to_owned(), study)]);
        assert!(report.entries()[0].analysis.variants().len() > 1);
        Ok(rows)
    }

    /// Changes the value at a JSON pointer, reads the study, and restores the file.
    ///
    /// Returns field, found value and expectation of the error.
    #[track_caller]
    fn with(&self, pointer: &str, value: Value) -> (String, String, String) {
        let error = self.error_with(pointer, value);
        let Some(Place::Field(field)) = error.place else {
            panic!("{pointer}: {error:?}");
        };
        (field, error.found, error.expected)
    }

    /// Changes a value of the configuration, restores the file, and returns the error.
    #[track_caller]
    fn error_with(&self, pointer: &str, value: Value) -> IoError {
        let before = self.text(CONFIG_FILE);
        let mut config: Value = serde_json::from_str(&before).unwrap();
        *config.pointer_mut(pointer).unwrap() = value;
        self.write(CONFIG_FILE, config.to_string());
        let outcome = self.read();
        self.write(CONFIG_FILE, before);
        let error = content_error(outcome);
        assert_eq!(error.path, self.path(CONFIG_FILE));
        error
    }

    /// Changes the rows, asserts the line and a part of the error, and restores the file.
    ///
    /// Returns the message.
    #[track_caller]
    fn refuses_rows(&self, change: impl FnOnce(&str) -> String, line: usize, part: &str) -> String {
        let before = self.text(self.rows);
        let after = change(&before);
        assert_ne!(before, after);
        self.write(self.rows, after);
        let outcome = self.read();
        self.write(self.rows, before);
        let error = content_error(outcome);
        assert_eq!(error.path, self.path(self.rows));
        assert_eq!(error.place, Some(Place::Line(line)), "{error}");
        let what = format!("{}, expected {}", error.found, error.expected);
        assert_contains(&what, &[part]);
        what
    }
}

impl Deref for Stored {
    type Target = Folder;

    fn deref(&self) -> &Folder {
        &self.folder
    }
}

/// Returns the error, which must be about the content of a file.
#[track_caller]
fn content_error<T: std::fmt::Debug>(result: Result<T, ExperimentError>) -> IoError {
    error_of_kind(result, IoErrorKind::Content)
}

#[track_caller]
fn error_of_kind<T: std::fmt::Debug>(
    result: Result<T, ExperimentError>,
    kind: IoErrorKind,
) -> IoError {
    match result {
        Err(ExperimentError::Io(error)) if error.kind == kind => error,
        result => panic!("{result:?}"),
    }
}

#[test]
fn unchanged_studies_are_read() {
    assert_eq!(Stored::single().read().unwrap(), 8);
    assert_eq!(Stored::sequential().read().unwrap(), 24);
}

/// Resumes a study, and stops it before the first case, so that nothing is computed.
fn resume(stored: &Stored) -> Result<(), ExperimentError> {
    let folder = stored.root();
    let config = stored.text(CONFIG_FILE);
    let options = RunOptions {
        resume: true,
        ..RunOptions::default()
    };
    let stop = &mut |_| ControlFlow::Break(());
    match stored.rows {
        Config::ROWS_FILE => {
            let config: Config = serde_json::from_str(&config).unwrap();
            run(&config, &subjects(), folder, options, stop)
        }
        _ => {
            let config: TrajectoryConfig = serde_json::from_str(&config).unwrap();
            run(&config, &subjects(), folder, options, stop)
        }
    }
}

#[test]
fn a_study_resumes_only_from_its_own_first_rows() {
    for (stored, per_case) in [(Stored::single(), 2), (Stored::sequential(), 4)] {
        let whole = stored.text(stored.rows);
        let cases = (whole.lines().count() - 1) / per_case;
        let stopped = |expected: usize| match resume(&stored) {
            Err(ExperimentError::Stopped { cases }) => assert_eq!(cases, expected),
            outcome => panic!("{outcome:?}"),
        };
        stopped(cases);
        assert_eq!(stored.text(stored.rows), whole);
        // The file ends within the last row, also if it is padded with zeros.
        stored.write(stored.rows, &whole[..whole.len() - 3]);
        stopped(cases - 1);
        let padded = [&whole.as_bytes()[..whole.len() - 3], &[0; 100]].concat();
        stored.write(stored.rows, padded);
        stopped(cases - 1);
        stored.write(stored.rows, &whole);

        let lines: Vec<&str> = whole.split_inclusive('\n').collect();
        let mut swapped = lines.clone();
        swapped.swap(1, 2);
        let mut gap = lines.clone();
        gap.drain(1..=per_case);
        let mut blank = lines.clone();
        blank.splice(2..2, std::iter::repeat_n("\n", per_case));
        let changed = [
            (whole.replacen("mug", "pan", 1), "object \"pan\""),
            (swapped.concat(), "the order in which a run writes rows"),
            (gap.concat(), "the order in which a run writes rows"),
            (blank.concat(), "one line"),
        ];
        for (rows, part) in changed {
            stored.write(stored.rows, &rows);
            let error = content_error(resume(&stored));
            assert_eq!(error.path, stored.path(stored.rows));
            assert_contains(&error.to_string(), &[part]);
            // The file is not overwritten.
            assert_eq!(stored.text(stored.rows), rows);
        }
        // A damaged byte makes a field invalid.
        let mut foreign = whole.clone().into_bytes();
        let place = whole.rfind("0.04").unwrap();
        foreign[place] = 0xff;
        stored.write(stored.rows, &foreign);
        let line = format!("line {}", whole.lines().count());
        refused(resume(&stored), &[&line, "vsd_final \"\u{fffd}.04\""]);
        assert_eq!(stored.bytes(stored.rows), foreign);
        let utf16: Vec<u8> = whole.encode_utf16().flat_map(u16::to_be_bytes).collect();
        stored.write(stored.rows, &utf16);
        let error = error_of_kind(resume(&stored), IoErrorKind::Encoding);
        assert_contains(&error.found, &["UTF-16 BE"]);
    }
}

#[test]
fn handmade_studies_do_not_panic() {
    let stored = Stored::single();
    let study = Study::read(stored.root()).unwrap();
    type Change = fn(&mut Study);
    let changes: [Change; 6] = [
        |study| study.rows.clear(),
        |study| study.config.bins = 0,
        |study| study.config.objects.clear(),
        |study| study.config.variants.clear(),
        |study| study.config.levels.clear(),
        |study| (study.config.poses, study.config.bins) = (u64::MAX, 3),
    ];
    for change in changes {
        for experiment in Experiment::ALL {
            let mut study = study.clone();
            study.config.experiment = experiment;
            change(&mut study);
            let report = Report::of(vec![("it".to_owned(), study)]);
            report.write(&stored.path("out")).unwrap();
        }
    }
}
