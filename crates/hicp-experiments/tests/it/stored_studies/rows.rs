//! Rows that contradict their configuration, and encodings.

use super::*;

type Tighten = fn(&mut ReadLimits);

#[test]
fn rows_that_contradict_the_configuration_are_refused() {
    let stored = Stored::single();
    let first = "mug,0,hybrid,0,0,0.05,0.04";
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
        stored.refuses_rows(|rows| rows.replacen(first, row, 1), 2, part);
    }
    stored.refuses_rows(
        |rows| rows.replacen("book,1,hybrid", "pan,1,hybrid", 1),
        8,
        "object \"pan\", expected \"book\"",
    );
    // A run writes every row once, on one line, and no row after the last one.
    stored.refuses_rows(
        |rows| rows.replacen("2.5,,\n", "2.5,,\"two\nlines\"\n", 1),
        4,
        "each on one line",
    );
    stored.refuses_rows(
        |rows| format!("{rows}{}", rows.lines().last().unwrap()),
        10,
        "another row, expected at most 8",
    );
    let twice = |rows: &str| {
        let first = rows.split_inclusive('\n').nth(1).unwrap();
        rows.replacen(first, &first.repeat(2), 1)
    };
    let part = "variant \"hybrid\", expected \"nn-point-to-point\"";
    stored.refuses_rows(twice, 3, part);
    stored.refuses_rows(
        |rows| rows.replacen("variant", "pipeline", 1),
        1,
        "\"object,case,pipeline",
    );
    // A message does not contain a whole value of a megabyte.
    let long = format!("{},0,hybrid,0,0,0.05,0.04", "x".repeat(1 << 20));
    let what = stored.refuses_rows(|rows| rows.replacen(first, &long, 1), 2, "");
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
        stored.refuses_rows(|rows| rows.replacen(first, row, 1), 2, part);
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
        let folder = stored.root();
        let within = |limits: &ReadLimits| match stored.rows {
            Config::ROWS_FILE => Study::read_within(limits, folder).map(|_| ()),
            _ => TrajectoryStudy::read_within(limits, folder).map(|_| ()),
        };
        let limits: [(&str, Tighten); 3] = [
            ("max_small_json_bytes", |l| l.max_small_json_bytes = 50),
            ("max_file_bytes", |l| l.max_file_bytes = 50),
            ("max_rows", |l| l.max_rows = 7),
        ];
        for (field, tighten) in limits {
            let mut limits = ReadLimits::DEFAULT;
            tighten(&mut limits);
            let error = error_of_kind(within(&limits), IoErrorKind::Limit);
            assert_contains(&error.expected, &[field]);
        }
        for name in [CONFIG_FILE, stored.rows] {
            let before = stored.text(name);
            stored.write(name, format!("\u{feff}{before}"));
            stored.read().unwrap();
            let utf16: Vec<u8> = before.encode_utf16().flat_map(u16::to_le_bytes).collect();
            for bytes in [[&[0xff, 0xfe], &utf16[..]].concat(), utf16] {
                stored.write(name, bytes);
                let error = error_of_kind(stored.read(), IoErrorKind::Encoding);
                assert_eq!(error.path, stored.path(name));
                assert_contains(&error.found, &["UTF-16 LE"]);
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
