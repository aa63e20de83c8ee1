//! Runs the fuzz targets on their seeds and on everything that the fuzzers found, without a fuzzer.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use hicp_tests::fuzz::{TARGETS, run};

fn fuzz_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz")
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .collect();
    found.sort();
    found
}

/// Returns every target with its files in one of the folders of `fuzz/`.
fn files(kind: &str) -> Vec<(&'static str, PathBuf)> {
    TARGETS
        .iter()
        .flat_map(|(name, _)| {
            let found = entries(&fuzz_folder().join(kind).join(name));
            found.into_iter().map(|file| (*name, file))
        })
        .collect()
}

fn replay(kind: &str) {
    for (name, file) in files(kind) {
        eprintln!("{name}: {}", file.display());
        run(name, &std::fs::read(&file).unwrap());
    }
}

#[test]
fn findings_of_the_fuzzers_stay_fixed() {
    replay("regressions");
}

#[test]
fn every_target_passes_on_its_seeds() {
    replay("seeds");
}

#[test]
fn every_target_has_seeds_and_a_program_and_nothing_else_exists() {
    let names: BTreeSet<&str> = TARGETS.iter().map(|(name, _)| *name).collect();
    let stems = |folder: &str| -> BTreeSet<String> {
        let files = entries(&fuzz_folder().join(folder));
        files
            .iter()
            .map(|file| file.file_stem().unwrap().to_string_lossy().into_owned())
            .collect()
    };
    let expected: BTreeSet<String> = names.iter().map(|name| (*name).to_owned()).collect();
    assert_eq!(stems("fuzz_targets"), expected);
    assert_eq!(stems("seeds"), expected);
    assert!(stems("regressions").is_subset(&expected));
    for name in names {
        assert!(
            !entries(&fuzz_folder().join("seeds").join(name)).is_empty(),
            "{name} has no seeds"
        );
    }
}
