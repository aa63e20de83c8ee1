//! Runs the fuzz targets on their seeds, on everything that the fuzzers found, and on random bytes,
//! without a fuzzer.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use hicp_tests::fuzz::{TARGETS, run};
use proptest::prelude::*;

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

/// Readers, with the beginning of a file that gets random bytes past their first checks.
const STARTS: [(&str, &str); 15] = [
    ("obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf "),
    ("stl", "solid x\nfacet normal 0 0 1\nouter loop\nvertex "),
    ("ply", "ply\nformat ascii 1.0\nelement vertex "),
    (
        "ply",
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty int y\n\
         property list char int z\nend_header\n",
    ),
    (
        "ply",
        "ply\nformat binary_big_endian 1.0\nelement face 9\n\
         property list int short vertex_index\nend_header\n",
    ),
    (
        "ply",
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n\
         property float y\nproperty double z\nelement face 2\n\
         property list uchar uchar vertex_indices\nend_header\n",
    ),
    ("png", "\u{89}PNG\r\n\u{1a}\n"),
    ("pose_json", "{\""),
    ("camera_json", "{\""),
    // The first byte selects the file: cameras, information of models, targets, or detections.
    ("bop_json", "2{\"1\":{\"cam_K\":["),
    ("bop_json", "3{\"1\":{\"diameter\":"),
    ("bop_json", "4[{\"scene_id\":"),
    ("bop_json", "5[{\"scene_id\":"),
    (
        "results_csv",
        "scene_id,im_id,obj_id,score,R,t,time\n50,1,2,",
    ),
    ("pipeline_toml", "type = "),
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 800, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn readers_accept_any_bytes(
        (name, start) in prop::sample::select(&STARTS[..]),
        with_start in any::<bool>(),
        binary in prop::collection::vec(any::<u8>(), 0..200),
        text in "[-0-9 .,:/ev\\n\\\\\\[\\]{}\"f]{0,80}",
        as_text in any::<bool>(),
    ) {
        // The first character of a PNG signature is a single byte, which is not UTF-8.
        let start = start.chars().map(|c| u8::try_from(c).unwrap());
        let mut content: Vec<u8> = start.filter(|_| with_start).collect();
        content.extend(if as_text { text.into_bytes() } else { binary });
        run(name, &content);
    }
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
