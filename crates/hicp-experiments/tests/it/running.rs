//! Runs of studies: streaming, resuming, pairing, and any number of threads.

use std::ops::ControlFlow;

use hicp_core::{Model, PinholeCamera, TriMesh};
use hicp_experiments::{
    Config, Design, Experiment, ExperimentError, RunOptions, Study, Subject, Variant, run,
};
use hicp_io::LengthUnit;
use hicp_sim::Household;
use hybrid_icp::Preset;

use crate::common::{Folder, assert_contains, refused, subjects};

/// Creates a study without times and with a small camera.
fn config(experiment: Experiment, presets: &[Preset], poses: u64) -> Config {
    let variants: Vec<Variant> = presets.iter().copied().map(Variant::preset).collect();
    let mut config = Config::new(experiment, &subjects(), &variants, poses, 3).unwrap();
    config.times = false;
    config.camera = PinholeCamera::new(143.0, 143.0, 79.5, 59.5, 160, 120).unwrap();
    config
}

const ROWS: &str = Config::ROWS_FILE;
const TWO: [Preset; 2] = [Preset::Hybrid, Preset::ProjectivePointToPlane];

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let config = config(Experiment::DepthNoise, &TWO, 3);
    let (one, three) = (Folder::with(&config, 1), Folder::with(&config, 3));
    assert_eq!(one.bytes(ROWS), three.bytes(ROWS));
    let rows = one.bytes(ROWS).iter().filter(|b| **b == b'\n').count();
    assert_eq!(rows, 1 + 2 * 3 * 6 * 2);
}

#[test]
fn a_study_cut_anywhere_resumes_to_the_same_bytes() {
    let config = config(Experiment::InitNoise, &TWO, 4);
    let folder = Folder::with(&config, 1);
    let whole = folder.bytes(ROWS);
    let second_line = whole.iter().position(|b| *b == b'\n').unwrap() + 1;
    for cut in [
        0,
        7,
        second_line,
        second_line + 5,
        whole.len() / 2,
        whole.len() - 1,
        whole.len(),
    ] {
        folder.write(ROWS, &whole[..cut]);
        folder.run(&config, 2, true).unwrap();
        assert!(
            folder.bytes(ROWS) == whole,
            "cut at {cut} of {}",
            whole.len()
        );
    }
}

#[test]
fn a_stopped_study_keeps_whole_cases_and_resumes() {
    let config = config(Experiment::DepthNoise, &TWO, 2);
    let (whole, stopped) = (Folder::with(&config, 1), Folder::new());
    let options = RunOptions {
        threads: 2,
        ..RunOptions::default()
    };
    let outcome = run(&config, &subjects(), stopped.root(), options, &mut |done| {
        if done == 2 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    assert!(
        matches!(outcome, Err(ExperimentError::Stopped { cases: 2 })),
        "{outcome:?}"
    );
    let part = stopped.bytes(ROWS);
    assert!(part.len() < whole.bytes(ROWS).len() && whole.bytes(ROWS).starts_with(&part));
    assert_eq!(stopped.study::<Config>().rows.len(), 2 * 6 * 2);
    stopped.run(&config, 1, true).unwrap();
    assert_eq!(stopped.bytes(ROWS), whole.bytes(ROWS));
}

#[test]
fn a_foreign_file_is_not_overwritten() {
    let config = config(Experiment::InitNoise, &TWO, 1);
    let folder = Folder::with(&config, 1);
    let whole = folder.bytes(ROWS);
    let end = whole.iter().position(|byte| *byte == b'\n').unwrap();
    let mut other_column = whole.clone();
    other_column[end - 1] ^= 1;
    for foreign in [
        &b"a,b\n1,2\n"[..],
        b"a",
        b"\n",
        b"\0\0a",
        &other_column,
        &[&whole[..end], b"\r\n"].concat(),
    ] {
        folder.write(ROWS, foreign);
        let outcome = folder.run(&config, 1, true).unwrap_err();
        assert!(matches!(&outcome, ExperimentError::Io(_)), "{outcome}");
        assert_contains(&outcome.to_string(), &["cases.csv", "line 1"]);
        assert_eq!(folder.bytes(ROWS), foreign, "{outcome}");
    }
    for left in [&b"\0\0\0"[..], &[&whole[..end / 2], b"\0\0"].concat()] {
        folder.write(ROWS, left);
        folder.run(&config, 1, true).unwrap();
        assert!(folder.bytes(ROWS) == whole);
    }
}

#[test]
fn stored_rows_are_kept_with_their_times() {
    let mut config = config(Experiment::InitNoise, &TWO, 2);
    config.times = true;
    let folder = Folder::with(&config, 1);
    let whole = folder.bytes(ROWS);
    let half = whole.len() / 2;
    folder.write(ROWS, &whole[..half]);
    folder.run(&config, 1, true).unwrap();
    // Of four cases with two rows each, the first one is complete before the middle.
    let kept: usize = whole
        .split_inclusive(|b| *b == b'\n')
        .take(3)
        .map(<[u8]>::len)
        .sum();
    assert!(kept < half);
    assert_eq!(folder.bytes(ROWS)[..kept], whole[..kept]);
    let times = folder
        .study::<Config>()
        .rows
        .into_iter()
        .map(|r| r.measured.unwrap().cpu_ms.unwrap());
    // A clock with coarse ticks can return zero.
    assert!(times.into_iter().all(|ms| (0.0..60_000.0).contains(&ms)));
}

#[test]
fn another_study_in_the_folder_is_refused() {
    let config = config(Experiment::InitNoise, &TWO, 1);
    let folder = Folder::with(&config, 1);
    refused(folder.run(&config, 1, false), &["cases.csv", "--resume"]);
    let other = Config { seed: 4, ..config };
    let resumed = folder.run(&other, 1, true);
    refused(resumed, &["\"seed\": 3", "\"seed\": 4"]);
}

#[test]
fn every_variant_and_level_gets_the_same_start() {
    let config = config(Experiment::DepthNoise, &Preset::PAPER, 2);
    let folder = Folder::with(&config, 2);
    let study = folder.study::<Config>();
    let mut differing = 0;
    for case in study.rows.chunks_exact(6 * 9) {
        let first = case[0].measured.as_ref().unwrap();
        for row in case {
            assert_eq!((&row.object, row.case), (&case[0].object, case[0].case));
            let measured = row.measured.as_ref().unwrap();
            assert_eq!(measured.vsd_initial, first.vsd_initial);
            differing += usize::from(measured.vsd_final != first.vsd_final);
        }
    }
    // The variants and levels are different.
    assert!(differing > 100, "{differing}");

    // The result of a variant for a case does not depend on the other variants.
    let alone = config_of(&study, &[Preset::NnPointToPlane]);
    let other = Folder::with(&alone, 1);
    let together: Vec<_> = study
        .rows
        .into_iter()
        .filter(|r| r.variant == "nn-point-to-plane")
        .collect();
    assert_eq!(other.study::<Config>().rows, together);
}

fn config_of(study: &Study, presets: &[Preset]) -> Config {
    config(study.config.experiment, presets, study.config.poses)
}

#[test]
fn cases_cycle_through_the_bins() {
    let config = config(Experiment::InitNoise, &[Preset::ProjectivePointToPoint], 10);
    let folder = Folder::with(&config, 2);
    for row in folder.study::<Config>().rows {
        let measured = row.measured.unwrap();
        let bin = row.bin.unwrap();
        assert_eq!(bin as u64, row.case);
        let low = bin as f64 / 10.0;
        assert!(
            (low..=low + 0.1).contains(&measured.vsd_initial),
            "{}",
            measured.vsd_initial
        );
    }
}

#[test]
fn a_case_that_cannot_be_created_has_a_reason_and_the_others_are_run() {
    let mut config = config(Experiment::InitNoise, &TWO, 2);
    // Every initial pose is the true one, and falls into the first bin.
    config.max_translation_m = 0.0;
    config.camera = PinholeCamera::new(28.0, 28.0, 15.5, 11.5, 32, 24).unwrap();
    let folder = Folder::with(&config, 2);
    let rows = folder.study::<Config>().rows;
    assert_eq!(rows.len(), 2 * 2 * 2);
    for row in rows {
        // Two cases are spread over ten bins.
        assert!([0, 5].contains(&row.case), "{row:?}");
        assert_eq!(row.measured.is_some(), row.case == 0, "{row:?}");
        assert_eq!(
            row.note.contains("could not be filled"),
            row.case == 5,
            "{row:?}"
        );
    }
}

#[test]
fn thresholds_change_the_results_of_hybrid() {
    let config = config(Experiment::Alpha, &[Preset::Hybrid], 6);
    let folder = Folder::with(&config, 2);
    let rows = folder.study::<Config>().rows;
    assert_eq!(rows.len(), 2 * 6 * 21);
    let of = |level: &str| -> Vec<f64> {
        let rows = rows.iter().filter(|r| r.setting == level);
        rows.map(|r| r.measured.as_ref().unwrap().vsd_final)
            .collect()
    };
    assert_ne!(of("0.00"), of("1.00"));
    // With threshold 0, every start uses nearest neighbors first. With 0.05, bad starts do the
    // same.
    let bad = |level: &str| of(level)[5];
    assert_eq!(bad("0.00"), bad("0.05"));
}

#[test]
fn folders_and_names_are_checked() {
    let folder = Folder::new();
    refused(Subject::read_folder(folder.root()), &["found no mesh"]);
    let mug = Household::Mug.solid().to_mesh().unwrap();
    hicp_io::write_ply(folder.path("b.PLY"), &mug, LengthUnit::Meters).unwrap();
    hicp_io::write_obj(folder.path("a.obj"), &mug, LengthUnit::Meters).unwrap();
    folder.write("notes.txt", "");
    let read = Subject::read_folder(folder.root()).unwrap();
    let names: Vec<&str> = read.iter().map(|subject| &*subject.name).collect();
    assert_eq!(names, ["a", "b"]);

    let timing = |subjects: &[Subject], presets: &[Preset], poses| {
        let variants: Vec<Variant> = presets.iter().copied().map(Variant::preset).collect();
        Config::new(Experiment::Timing, subjects, &variants, poses, 1)
    };
    let hybrid = Preset::Hybrid;
    let twice = timing(&read, &[hybrid; 2], 1);
    refused(twice, &["variants: found \"hybrid\" twice"]);
    let none = timing(&read, &[hybrid], 0);
    refused(none, &["poses: found 0, expected 1 to 1000000"]);
    let fixed = [Variant::preset(Preset::NnPointToPoint)];
    assert!(Config::new(Experiment::Alpha, &read, &fixed, 1, 1).is_err());
    let mut large = subjects();
    let vertices = mug.vertices().iter().map(|p| p * 10.0).collect();
    let mesh = TriMesh::new(vertices, mug.triangles().to_vec()).unwrap();
    large[0].model = Model::new(mesh);
    let large = timing(&large, &[hybrid], 1);
    refused(large, &["objects[0].diameter_mm"]);
}
