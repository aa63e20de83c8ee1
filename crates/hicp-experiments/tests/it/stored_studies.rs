//! Files that no run wrote are refused, with their path and the field or the line.
//!
//! Nothing panics or allocates without limit.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use hicp_experiments::{
    Analysis, CONFIG_FILE, Config, Design, Experiment, ExperimentError, FusionRule, HIGH, LOW,
    MAX_BINS, MAX_CELLS, MAX_OBJECTS, Metric, Report, RunOptions, Study, Subject, TrajectoryConfig,
    TrajectoryReport, TrajectoryStudy, Variant, run,
};
use hicp_io::{IoError, IoErrorKind, Place, ReadLimits};
use hicp_sim::Household;
use hybrid_icp::Preset;
use serde_json::{Value, json};

/// A folder with the two files of a study.
struct Stored {
    folder: tempfile::TempDir,
    rows: &'static str,
}

impl Stored {
    /// Creates a study of two objects, two cases, two bins and two variants.
    fn single() -> Self {
        let presets = [Preset::Hybrid, Preset::NnPointToPoint].map(Variant::preset);
        let mut config = Config::new(Experiment::InitNoise, &subjects(), &presets, 2, 3).unwrap();
        config.bins = 2;
        let mut text = header::<Config>() + "\n";
        for object in ["mug", "book"] {
            for case in 0..2 {
                for variant in ["hybrid", "nn-point-to-point"] {
                    text += &format!(
                        "{object},{case},{variant},0,{case},0.{case}5,0.04,1.5,9,converged,2.5,,\n"
                    );
                }
            }
        }
        let stored = Self {
            folder: tempfile::tempdir().unwrap(),
            rows: Config::ROWS_FILE,
        };
        stored.write(
            CONFIG_FILE,
            serde_json::to_string_pretty(&config).unwrap() + "\n",
        );
        stored.write(Config::ROWS_FILE, text);
        stored
    }

    /// Creates a sequential study of two objects and one trajectory per bin.
    fn sequential() -> Self {
        let presets = [Preset::Hybrid, Preset::ProjectiveCascadePointPlane];
        let mut config = TrajectoryConfig::new(&subjects(), &presets, 1, 3).unwrap();
        config.methods.truncate(2);
        let mut text = header::<TrajectoryConfig>() + "\n";
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
        let stored = Self {
            folder: tempfile::tempdir().unwrap(),
            rows: TrajectoryConfig::ROWS_FILE,
        };
        stored.write(
            CONFIG_FILE,
            serde_json::to_string_pretty(&config).unwrap() + "\n",
        );
        stored.write(TrajectoryConfig::ROWS_FILE, text);
        stored
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Reads the study and analyzes it like a report.
    fn read(&self) -> Result<usize, ExperimentError> {
        let folder = self.folder.path();
        if self.rows == Config::ROWS_FILE {
            let study = Study::read(folder)?;
            let rows = study.rows.len();
            assert_eq!(
                Report::of(vec![("it".to_owned(), study)]).entries().len(),
                1
            );
            return Ok(rows);
        }
        let study = TrajectoryStudy::read(folder)?;
        let rows = study.rows.len();
        let report = TrajectoryReport::of(vec![("it".to_owned(), study)]);
        assert!(report.entries()[0].analysis.variants().len() > 1);
        Ok(rows)
    }

    /// Changes the value at a JSON pointer, reads the study, and restores the file.
    ///
    /// Returns field, found value and expectation of the error.
    #[track_caller]
    fn with(&self, pointer: &str, value: Value) -> (String, String, String) {
        let before = self.text(CONFIG_FILE);
        let mut config: Value = serde_json::from_str(&before).unwrap();
        *config.pointer_mut(pointer).unwrap() = value;
        self.write(CONFIG_FILE, config.to_string());
        let outcome = self.read();
        self.write(CONFIG_FILE, before);
        let error = content_error(outcome);
        assert_eq!(error.path, self.path(CONFIG_FILE));
        let Some(Place::Field(field)) = error.place else {
            panic!("{pointer}: {error:?}");
        };
        (field, error.found, error.expected)
    }

    /// Changes the rows, reads the study, and restores the file.
    ///
    /// Returns line and message of the error.
    #[track_caller]
    fn with_rows(&self, change: impl FnOnce(&str) -> String) -> (usize, String) {
        let before = self.text(self.rows);
        let after = change(&before);
        assert_ne!(before, after);
        self.write(self.rows, after);
        let outcome = self.read();
        self.write(self.rows, before);
        let error = content_error(outcome);
        assert_eq!(error.path, self.path(self.rows));
        let Some(Place::Line(line)) = error.place else {
            panic!("{error:?}");
        };
        (
            line,
            format!("{}, expected {}", error.found, error.expected),
        )
    }
}

/// Returns the error, which must be about the content of a file.
#[track_caller]
fn content_error<T: std::fmt::Debug>(result: Result<T, ExperimentError>) -> IoError {
    match result {
        Err(ExperimentError::Io(error)) if error.kind == IoErrorKind::Content => error,
        result => panic!("{result:?}"),
    }
}

fn header<D: Design>() -> String {
    D::COLUMNS
        .iter()
        .map(|column| column.0)
        .collect::<Vec<_>>()
        .join(",")
}

fn subjects() -> Vec<Subject> {
    Subject::household(&[Household::Mug, Household::Book]).unwrap()
}

#[test]
fn unchanged_studies_are_read() {
    assert_eq!(Stored::single().read().unwrap(), 8);
    assert_eq!(Stored::sequential().read().unwrap(), 24);
}

#[test]
fn fields_of_a_configuration_are_checked() {
    let stored = Stored::single();
    let one = json!({"name": "mug", "source": "", "triangles": 1, "diameter_mm": 100.0, "symmetric": false, "fingerprint": ""});
    let variant = json!({"name": "hybrid", "pipeline": ""});
    for (pointer, value, field, part) in [
        ("/bins", json!(0), "bins", "1 to 1000"),
        ("/bins", json!(4_000_000_000_u64), "bins", "1 to 1000"),
        (
            "/bins",
            json!(1_000_000_000_000_000_000_u64),
            "bins",
            "1 to 1000",
        ),
        ("/bins", json!(MAX_BINS + 1), "bins", "1 to 1000"),
        ("/poses", json!(0), "poses", "1 to 1000000"),
        ("/poses", json!(u64::MAX), "poses", "1 to 1000000"),
        ("/objects", json!([]), "objects", "1 to"),
        ("/objects", json!([one, one]), "objects", "different names"),
        (
            "/objects",
            json!(vec![&one; MAX_OBJECTS + 1]),
            "objects",
            "1 to 10000",
        ),
        (
            "/objects/1/diameter_mm",
            json!(0.0),
            "objects[1].diameter_mm",
            "above 0",
        ),
        ("/variants", json!([]), "variants", "1 to"),
        (
            "/variants",
            json!([variant, variant]),
            "variants",
            "different names",
        ),
        ("/levels", json!([]), "levels", "1 to 1"),
        (
            "/levels",
            json!(["1"]),
            "levels[0]",
            "\"0\", as in every init-noise study",
        ),
        ("/levels", json!(vec!["0"; 100_000]), "levels", "1 to 1"),
        (
            "/max_translation_m",
            json!(-0.1),
            "max_translation_m",
            "at least 0",
        ),
        ("/max_distance_m", json!(0.0), "max_distance_m", "above 0"),
        ("/camera/fx", json!(0.0), "camera", "a camera"),
        ("/camera/width", json!(u32::MAX), "camera", "a camera"),
    ] {
        let outcome = stored.with(pointer, value);
        assert_eq!(outcome.0, field);
        assert!(outcome.2.contains(part), "{field}: {outcome:?}");
    }
    let outcome = stored.with("/objects", json!([one, one]));
    assert_eq!(outcome.1, "\"mug\" twice");
    // Each number is within its limit, but their product is not.
    let many: Vec<Value> = (0..=MAX_CELLS / 2)
        .map(|i| json!({"name": i.to_string(), "pipeline": ""}))
        .collect();
    let outcome = stored.with("/variants", json!(many));
    assert_eq!(outcome.0, "levels × variants × bins");
    assert_eq!(
        (&*outcome.1, &*outcome.2),
        ("1 × 5001 × 2", "at most 10000")
    );
}

#[test]
fn fields_of_a_sequential_configuration_are_checked() {
    let stored = Stored::sequential();
    let hybrid = json!({"name": "hybrid", "pipeline": "", "seconds_per_estimate": 0.5, "seconds_per_mve": 0.1});
    for (pointer, value, field, part) in [
        (
            "/experiment",
            json!("init-noise"),
            "experiment",
            "\"sequential\"",
        ),
        ("/bins", json!(0), "bins", "1 to 1000"),
        ("/bins", json!(4_000_000_000_u64), "bins", "1 to 1000"),
        (
            "/trajectories",
            json!(u64::MAX),
            "trajectories",
            "1 to 100000",
        ),
        ("/objects", json!([]), "objects", "1 to"),
        ("/underlying", json!([]), "underlying", "1 to"),
        (
            "/underlying",
            json!([hybrid, hybrid]),
            "underlying",
            "different names",
        ),
        (
            "/underlying/0/seconds_per_estimate",
            json!(0.0),
            "underlying[0].seconds_per_estimate",
            "above 0",
        ),
        (
            "/underlying/0/seconds_per_mve",
            json!(-0.1),
            "underlying[0].seconds_per_mve",
            "at least 0",
        ),
        ("/depth_noise", json!("d435"), "depth_noise", "a noise"),
        (
            "/path",
            json!({"target": {"offset_m": -1.0}}),
            "path.target.offset_m",
            "at least 0",
        ),
        (
            "/reconstruction_truncation_m",
            json!(0.0),
            "reconstruction_truncation_m",
            "above 0",
        ),
        ("/methods", json!([]), "methods", "1 to"),
        (
            "/methods",
            json!(["average", "average"]),
            "methods",
            "different names",
        ),
        (
            "/methods",
            json!(["average", "mean"]),
            "methods[1]",
            "a method of the paper",
        ),
        ("/speed_m_s", json!(0.0), "speed_m_s", "above 0"),
        ("/path_m", json!(-1.0), "path_m", "at least 0"),
        ("/camera/fy", json!(-1.0), "camera", "a camera"),
    ] {
        let outcome = stored.with(pointer, value);
        assert_eq!(outcome.0, field);
        assert!(outcome.2.contains(part), "{field}: {outcome:?}");
    }
    // Each number is within its limit, but their product is not.
    let mut config: Value = serde_json::from_str(&stored.text(CONFIG_FILE)).unwrap();
    config["methods"] = json!(FusionRule::ALL.map(FusionRule::name));
    stored.write(CONFIG_FILE, config.to_string());
    let outcome = stored.with("/bins", json!(MAX_BINS));
    assert_eq!(outcome.0, "underlying × methods × bins");
    assert_eq!(
        (&*outcome.1, &*outcome.2),
        ("2 × 10 × 1000", "at most 10000")
    );
}

#[test]
fn rows_that_contradict_the_configuration_are_refused() {
    let stored = Stored::single();
    let first = "mug,0,hybrid,0,0,0.05,0.04";
    let instead = |row: &str| stored.with_rows(|rows| rows.replacen(first, row, 1));
    for (row, part) in [
        (
            "pan,0,hybrid,0,0,0.05,0.04",
            "object \"pan\", expected \"mug\", by config.json",
        ),
        (
            "mug,0,search,0,0,0.05,0.04",
            "variant \"search\", expected \"hybrid\", by config.json",
        ),
        (
            "mug,0,hybrid,7,0,0.05,0.04",
            "level \"7\", expected \"0\", by config.json",
        ),
        ("mug,2,hybrid,0,2,0.05,0.04", "case \"2\", expected \"0\""),
        ("mug,0,hybrid,0,10,0.05,0.04", "bin \"10\", expected \"0\""),
        ("mug,0,hybrid,0,1,0.05,0.04", "bin \"1\", expected \"0\""),
        ("mug,0,hybrid,0,,0.05,0.04", "bin \"\", expected \"0\""),
        (
            "mug,0,hybrid,0,0,1.5,0.04",
            "vsd_initial \"1.5\", expected a number from 0 to 1",
        ),
        ("mug,0,hybrid,0,0,0.05,1e300", "vsd_final \"1e300\""),
        ("mug,0,hybrid,0,0,0.05,NaN", "vsd_final \"NaN\""),
        ("mug,0,hybrid,0,0,0.05,0.04,1", "14 fields, expected 13"),
    ] {
        let (line, what) = instead(row);
        assert!(line == 2 && what.contains(part), "{line}: {what}");
    }
    let (line, what) = stored.with_rows(|rows| rows.replacen("book,1,hybrid", "pan,1,hybrid", 1));
    assert!(
        line == 8 && what.contains("object \"pan\", expected \"book\""),
        "{line}: {what}"
    );
    // A run writes every row once, on one line, and no row after the last one.
    let (line, what) =
        stored.with_rows(|rows| rows.replacen("2.5,,\n", "2.5,,\"two\nlines\"\n", 1));
    assert!(line == 4 && what.contains("each on one line"), "{what}");
    let (line, what) = stored.with_rows(|rows| format!("{rows}{}", rows.lines().last().unwrap()));
    assert!(
        line == 10 && what.contains("another row, expected at most 8"),
        "{what}"
    );
    let (line, what) = stored.with_rows(|rows| {
        let first = rows.split_inclusive('\n').nth(1).unwrap();
        rows.replacen(first, &first.repeat(2), 1)
    });
    assert!(
        line == 3 && what.contains("variant \"hybrid\", expected \"nn-point-to-point\""),
        "{what}"
    );
    let (line, what) = stored.with_rows(|rows| rows.replacen("variant", "pipeline", 1));
    assert!(
        line == 1 && what.contains("\"object,case,pipeline"),
        "{what}"
    );
    // A message does not contain a whole value of a megabyte.
    let (_, what) = instead(&format!("{},0,hybrid,0,0,0.05,0.04", "x".repeat(1 << 20)));
    assert!(what.len() < 250, "{} bytes", what.len());
}

#[test]
fn rows_that_contradict_a_sequential_configuration_are_refused() {
    let stored = Stored::sequential();
    let first = "mug,0,0,hybrid,last-estimate,0.05,0.04";
    for (row, part) in [
        ("pan,0,0,hybrid,last-estimate,0.05,0.04", "object \"pan\""),
        (
            "mug,10,0,hybrid,last-estimate,0.05,0.04",
            "trajectory \"10\", expected \"0\"",
        ),
        (
            "mug,0,1,hybrid,last-estimate,0.05,0.04",
            "bin \"1\", expected \"0\"",
        ),
        (
            "mug,0,0,local,last-estimate,0.05,0.04",
            "underlying \"local\"",
        ),
        ("mug,0,0,hybrid,filtering,0.05,0.04", "method \"filtering\""),
        (
            "mug,0,0,hybrid,average,0.05,0.04",
            "method \"average\", expected \"last-estimate\"",
        ),
        ("mug,0,0,hybrid,last-estimate,0.05,2", "vsd_final \"2\""),
    ] {
        let (line, what) = stored.with_rows(|rows| rows.replacen(first, row, 1));
        assert!(line == 2 && what.contains(part), "{line}: {what}");
    }
}

#[test]
fn a_study_without_rows_is_refused() {
    for stored in [Stored::single(), Stored::sequential()] {
        let header = stored.text(stored.rows).lines().next().unwrap().to_owned() + "\n";
        stored.write(stored.rows, header);
        let error = content_error(stored.read());
        assert_eq!(error.path, stored.path(stored.rows));
        assert_eq!(error.found, "no finished row");
    }
}

#[test]
fn encodings_and_limits_are_reported() {
    for stored in [Stored::single(), Stored::sequential()] {
        let folder = stored.folder.path();
        let within = |limits: &ReadLimits| match stored.rows {
            Config::ROWS_FILE => Study::read_within(limits, folder).map(|_| ()),
            _ => TrajectoryStudy::read_within(limits, folder).map(|_| ()),
        };
        for (limits, field) in [
            (
                ReadLimits {
                    max_small_json_bytes: 50,
                    ..ReadLimits::DEFAULT
                },
                "max_small_json_bytes",
            ),
            (
                ReadLimits {
                    max_file_bytes: 50,
                    ..ReadLimits::DEFAULT
                },
                "max_file_bytes",
            ),
            (
                ReadLimits {
                    max_rows: 7,
                    ..ReadLimits::DEFAULT
                },
                "max_rows",
            ),
        ] {
            match within(&limits) {
                Err(ExperimentError::Io(error)) if error.kind == IoErrorKind::Limit => {
                    assert!(error.expected.contains(field), "{error}");
                }
                outcome => panic!("{field}: {outcome:?}"),
            }
        }
        for name in [CONFIG_FILE, stored.rows] {
            let before = stored.text(name);
            stored.write(name, format!("\u{feff}{before}"));
            stored.read().unwrap();
            let utf16: Vec<u8> = before.encode_utf16().flat_map(u16::to_le_bytes).collect();
            for bytes in [[&[0xff, 0xfe], &utf16[..]].concat(), utf16] {
                stored.write(name, bytes);
                match stored.read() {
                    Err(ExperimentError::Io(IoError {
                        kind: IoErrorKind::Encoding,
                        path,
                        found,
                        ..
                    })) => {
                        assert_eq!(path, stored.path(name));
                        assert!(found.contains("UTF-16 LE"), "{found}");
                    }
                    outcome => panic!("{name}: {outcome:?}"),
                }
            }
            stored.write(name, [before.as_bytes(), b"\xff"].concat());
            assert!(
                matches!(stored.read(), Err(ExperimentError::Io(IoError { path, place: Some(Place::Byte(_)), .. })) if path == stored.path(name))
            );
            stored.write(name, before);
        }
        stored.read().unwrap();
    }
}

/// Resumes a study, and stops it before the first case, so that nothing is computed.
fn resume(stored: &Stored) -> Result<(), ExperimentError> {
    let folder = stored.folder.path();
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
        stored.write(
            stored.rows,
            [&whole.as_bytes()[..whole.len() - 3], &[0; 100]].concat(),
        );
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
            assert!(error.to_string().contains(part), "{error}");
            // The file is not overwritten.
            assert_eq!(stored.text(stored.rows), rows);
        }
        // A damaged byte makes a field invalid.
        let mut foreign = whole.clone().into_bytes();
        let place = whole.rfind("0.04").unwrap();
        foreign[place] = 0xff;
        stored.write(stored.rows, &foreign);
        let outcome = resume(&stored).unwrap_err().to_string();
        let (line, field) = (whole.lines().count(), "vsd_final \"\u{fffd}.04\"");
        assert!(
            outcome.contains(&format!("line {line}")) && outcome.contains(field),
            "{outcome}"
        );
        assert_eq!(std::fs::read(stored.path(stored.rows)).unwrap(), foreign);
        let utf16: Vec<u8> = whole.encode_utf16().flat_map(u16::to_be_bytes).collect();
        stored.write(stored.rows, &utf16);
        assert!(matches!(
            resume(&stored),
            Err(ExperimentError::Io(IoError { kind: IoErrorKind::Encoding, found, .. })) if found.contains("UTF-16 BE")
        ));
    }
}

#[test]
fn invalid_configurations_are_not_run() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let presets = [Variant::preset(Preset::Hybrid)];
    let mut config = Config::new(Experiment::InitNoise, &subjects(), &presets, 2, 3).unwrap();
    config.bins = 0;
    let go = &mut |_| ControlFlow::Continue(());
    let outcome = run(&config, &subjects(), &out, RunOptions::default(), go).unwrap_err();
    assert!(
        outcome
            .to_string()
            .ends_with("bins: found 0, expected 1 to 1000"),
        "{outcome}"
    );
    let mut config = TrajectoryConfig::new(&subjects(), &[Preset::Hybrid], 1, 3).unwrap();
    config.bins = 0;
    let outcome = run(&config, &subjects(), &out, RunOptions::default(), go).unwrap_err();
    assert!(
        outcome
            .to_string()
            .ends_with("bins: found 0, expected 1 to 1000"),
        "{outcome}"
    );
    assert!(!out.exists());
}

/// The configurations of the committed results are still valid; only their rows are not committed.
#[test]
fn the_committed_configurations_are_read() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/study");
    if !docs.is_dir() {
        eprintln!("SKIPPED: the package has no {}", docs.display());
        return;
    }
    for name in ["beyond", "sequential", "sequential/improved"] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::copy(
            docs.join(name).join(CONFIG_FILE),
            folder.path().join(CONFIG_FILE),
        )
        .unwrap();
        let put =
            |rows: &str, text: String| std::fs::write(folder.path().join(rows), text).unwrap();
        if name == "beyond" {
            put(
                Config::ROWS_FILE,
                header::<Config>() + "\nbowl,0,hybrid,perfect,0,0.05,0.04,1.5,9,converged,2.5,,\n",
            );
            let outcome = Study::read(folder.path());
            assert!(
                outcome.is_ok_and(|study| study.config.levels.len() == 14),
                "{name}"
            );
        } else {
            let row = "\nbowl,0,0,hybrid,last-estimate,0.05,0.04,1.5,9,2.5,\n";
            let rows = header::<TrajectoryConfig>() + row;
            put(TrajectoryConfig::ROWS_FILE, rows);
            let outcome = TrajectoryStudy::read(folder.path());
            assert!(outcome.is_ok_and(|study| study.config.bins == 10), "{name}");
        }
    }
}

#[test]
fn ranges_of_bins_have_fixed_limits_of_the_initial_vsd() {
    for (bins, low, high, first) in [
        (10, 0..3, 7..10, "0.0-0.1"),
        (20, 0..6, 14..20, "0.00-0.05"),
        (7, 0..2, 5..7, "0.000-0.143"),
        (1, 0..0, 1..1, "0.0-1.0"),
    ] {
        let stored = Stored::single();
        let mut study = Study::read(stored.folder.path()).unwrap();
        study.config.bins = bins;
        let analysis = Analysis::of(&study);
        let range = |label| {
            let group = analysis.group(label).unwrap();
            analysis.groups()[group].bins.clone().unwrap()
        };
        assert_eq!((range(LOW), range(HIGH)), (low, high), "{bins}");
        assert_eq!(analysis.groups()[0].label, first);
        let all = analysis.mean(Metric::Vsd, analysis.overall(), 0).unwrap();
        assert!((all.estimate - 0.04).abs() < 1e-12);
        // There is no such group or variant.
        assert!(
            analysis
                .mean(Metric::Vsd, analysis.groups().len(), 0)
                .is_none()
        );
        assert!(analysis.mean(Metric::Vsd, 0, 2).is_none());
        assert!(
            analysis.cell(analysis.groups().len(), 0).is_none() && analysis.cell(0, 2).is_none()
        );
        let figures = Report::of(vec![("it".to_owned(), study)]).figures();
        let points = &figures[0].1.rows[0][0].curves[0].points;
        assert!((points[0].0 - 0.5 / bins as f64).abs() < 1e-12);
    }
}

#[test]
fn handmade_studies_do_not_panic() {
    let stored = Stored::single();
    let study = Study::read(stored.folder.path()).unwrap();
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
