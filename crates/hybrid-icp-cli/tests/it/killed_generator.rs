//! Runs of `bop generate` that are killed or interrupted.
#![cfg(unix)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Instant;

use crate::common::*;
use rand::RngExt as _;

type Files = BTreeMap<PathBuf, Vec<u8>>;

/// Returns all files below a folder; none if it does not exist.
fn files(folder: &Path) -> Files {
    let mut found = Files::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_owned();
                found.insert(name, std::fs::read(path).unwrap());
            }
        }
    }
    found
}

/// A generated dataset appears when it is complete.
///
/// If a run is killed, the name stays free, or the existing folder stays empty.
#[test]
fn a_killed_generator_leaves_no_part_of_a_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let words = "bop generate --scenes 2 --images 2 --instances 3 --seed 3 --threads 1 --out";
    let words = |out: &'static str| words.split(' ').chain([out]).collect::<Vec<_>>();
    let begun = Instant::now();
    run(folder, words("whole")).exits(0);
    let longest = begun.elapsed();
    let whole = files(&folder.join("whole"));
    assert!(whole.len() > 30);
    std::fs::create_dir(folder.join("empty")).unwrap();
    std::fs::create_dir(folder.join("mine")).unwrap();
    std::fs::write(folder.join("mine/note"), "the user's").unwrap();
    let mut rng = hicp_sim::rng(5);
    let mut unfinished = 0;
    for (round, out) in ["new", "empty"].into_iter().cycle().take(8).enumerate() {
        let signal = if round < 4 { "-KILL" } else { "-INT" };
        let child = program(folder)
            .args(words(out))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(longest.mul_f64(rng.random_range(0.0..0.9)));
        send(signal, &child);
        let output = child.wait_with_output().unwrap();
        let ended = output.status;
        if ended.code() == Some(130) {
            // Failures caused by removing the unfinished folder are not reported.
            let told = String::from_utf8_lossy(&output.stderr);
            assert_eq!(told, "error: interrupted\n");
        }
        let found = files(&folder.join(out));
        if ended.success() {
            assert!(found == whole, "{out}");
            std::fs::remove_dir_all(folder.join(out)).unwrap();
            if out == "empty" {
                std::fs::create_dir(folder.join(out)).unwrap();
            }
            continue;
        }
        unfinished += 1;
        // The dataset is complete if the program was killed after renaming it.
        assert!(
            found.is_empty() || found == whole,
            "{out}: {} files",
            found.len()
        );
        if out == "new" {
            assert!(!folder.join(out).exists() || found == whole);
        }
        let _ = std::fs::remove_dir_all(folder.join(out));
        if out == "empty" {
            std::fs::create_dir(folder.join(out)).unwrap();
        }
        let left = names(folder).into_iter();
        let left: Vec<String> = left.filter(|name| name.starts_with(".hicp-")).collect();
        if signal == "-INT" && ended.code() == Some(130) {
            assert_eq!(
                left, [""; 0],
                "an interrupted run removes its temporary files"
            );
        }
        for name in left {
            std::fs::remove_dir_all(folder.join(name)).unwrap();
        }
    }
    assert!(unfinished > 0);
    assert_eq!(names(folder), ["empty", "mine", "whole"]);
    assert!(files(&folder.join("whole")) == whole);
    // Leftover temporary folders do not disturb another run.
    std::fs::create_dir(folder.join(".hicp-x.tmp")).unwrap();
    run(folder, words("empty")).exits(0);
    assert!(files(&folder.join("empty")) == whole);
    run(folder, words("mine"))
        .exits(1)
        .complains(&["has 1 entries"]);
    assert_eq!(
        std::fs::read(folder.join("mine/note")).unwrap(),
        b"the user's"
    );
}
