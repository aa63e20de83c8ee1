//! Pipes without a writer, endless devices, and folders in the place of inputs.
//!
//! Each is reported, and the program never waits. One function of `hicp-io` opens the files that
//! commands read, so one command per kind of reader is enough.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::*;
use hicp_io::bop::write_results;

/// After this time, the program counts as hanging; these runs compute almost nothing.
const HANGS_AFTER: Duration = Duration::from_secs(300);

/// Runs the program, and kills it if it hangs.
#[track_caller]
fn ends(folder: &Folder, words: &str) -> Run {
    let mut child = program(folder.root())
        .args(words.split_whitespace())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > HANGS_AFTER {
            child.kill().unwrap();
            panic!("{words:?} hangs");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    Run::from(child.wait_with_output().unwrap())
}

/// Things that may be in the place of a file.
const STRANGERS: [&str; 3] = ["a pipe", "a device", "a folder"];

/// Creates a stranger at a path that does not exist.
fn put(kind: &str, path: &Path) {
    match kind {
        "a pipe" => assert!(Command::new("mkfifo").arg(path).status().unwrap().success()),
        "a device" => std::os::unix::fs::symlink("/dev/zero", path).unwrap(),
        _ => std::fs::create_dir(path).unwrap(),
    }
}

fn take_away(path: &Path) {
    if std::fs::symlink_metadata(path).unwrap().is_dir() {
        std::fs::remove_dir(path).unwrap();
    } else {
        std::fs::remove_file(path).unwrap();
    }
}

/// Replaces a file by each stranger, asserts that the run fails, and restores the file.
#[track_caller]
fn each_is_reported(folder: &Folder, words: &str, file: &str) {
    let (path, aside) = (folder.path(file), folder.path("aside"));
    std::fs::rename(&path, &aside).unwrap();
    for kind in STRANGERS {
        put(kind, &path);
        let told = ends(folder, words);
        assert_eq!(told.code, 1, "{kind} for {file}: {}{}", told.out, told.err);
        assert!(
            told.err.starts_with("error: "),
            "{kind} for {file}: {}",
            told.err
        );
        assert!(told.err.contains(file), "{kind} for {file}: {}", told.err);
        take_away(&path);
    }
    std::fs::rename(&aside, &path).unwrap();
}

#[test]
fn every_input_of_refine() {
    let scene = Scene::new();
    let hybrid = ends(&scene, "pipelines --show hybrid").exits(0);
    scene.write("mine.toml", hybrid.out);
    let words = "refine --model mesh.ply --model-unit m --depth depth.png --depth-scale 0.1 --mask mask.png \
                 --camera camera.json --init init.json --pipeline mine.toml --output out.json";
    let folder = &scene.folder;
    for file in [
        "mesh.ply",
        "depth.png",
        "mask.png",
        "camera.json",
        "init.json",
        "mine.toml",
    ] {
        each_is_reported(folder, words, file);
        assert!(!scene.path("out.json").exists(), "{file}");
    }
    // With all files restored, the command succeeds.
    ends(folder, words).exits(0);
}

#[test]
fn results_and_journal_of_a_dataset() {
    let world = World::new();
    let folder = &world.folder;
    write_results(world.path("in.csv"), &world.rows()).unwrap();
    let refine = "bop refine --dataset . --results in.csv --output out.csv";
    each_is_reported(folder, refine, "in.csv");
    world.write("out.csv.journal", "");
    each_is_reported(folder, refine, "out.csv.journal");
    world.remove("out.csv.journal");
    assert!(!world.path("out.csv").exists());
}

/// In a dataset's folders, an entry that is not a file counts as missing: its rows are kept.
#[test]
fn every_file_of_a_dataset() {
    let world = World::new();
    let folder = &world.folder;
    write_results(world.path("in.csv"), &world.rows()).unwrap();
    let words = "bop refine --dataset . --results in.csv --output out.csv --no-time";
    for file in [
        "models/obj_000001.ply",
        "test/000003/scene_camera.json",
        "test/000003/scene_gt.json",
        "test/000003/depth/000000.png",
        "test/000003/mask_visib/000000_000000.png",
    ] {
        let (path, aside) = (folder.path(file), folder.path("aside"));
        std::fs::rename(&path, &aside).unwrap();
        for kind in STRANGERS {
            put(kind, &path);
            let told = ends(folder, words);
            assert!(
                told.code == 0 || told.err.contains("error: "),
                "{kind} for {file}: {}",
                told.err
            );
            // The rows of the other scene are refined anyway.
            assert!(
                told.out.contains(" refined"),
                "{kind} for {file}: {}",
                told.out
            );
            assert!(!told.err.contains("panicked"));
            take_away(&path);
        }
        std::fs::rename(&aside, &path).unwrap();
    }
}
