//! Runs of `bop generate` that are killed or interrupted.

use std::process::Stdio;
use std::time::Instant;

use crate::common::*;
use rand::RngExt as _;

/// A generated dataset appears when it is complete.
///
/// If a run is killed, the name stays free, or the existing folder stays empty.
#[test]
fn a_killed_generator_leaves_no_part_of_a_dataset() {
    let folder = Folder::new();
    let command = |out: &str| {
        format!("bop generate --scenes 2 --images 2 --instances 3 --seed 3 --threads 1 --out {out}")
    };
    let begun = Instant::now();
    folder.command(command("whole")).exits(0);
    let longest = begun.elapsed();
    let whole = folder.files("whole");
    assert!(whole.len() > 30);
    folder.create_dir("empty");
    folder.create_dir("mine");
    folder.write("mine/note", "the user's");
    let mut rng = hicp_sim::rng(5);
    let mut unfinished = 0;
    for (round, out) in ["new", "empty"].into_iter().cycle().take(8).enumerate() {
        let signal = if round < 4 { "-KILL" } else { "-INT" };
        let child = program(folder.root())
            .args(command(out).split(' '))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(longest.mul_f64(rng.random_range(0.0..0.9)));
        send(signal, &child);
        let ended = Run::from(child.wait_with_output().unwrap());
        if ended.code == 130 {
            // Failures caused by removing the unfinished folder are not reported.
            assert_eq!(ended.err, "error: interrupted\n");
        }
        let found = folder.files(out);
        if ended.code == 0 {
            assert!(found == whole, "{out}");
            std::fs::remove_dir_all(folder.path(out)).unwrap();
            if out == "empty" {
                folder.create_dir(out);
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
            assert!(!folder.path(out).exists() || found == whole);
        }
        let _ = std::fs::remove_dir_all(folder.path(out));
        if out == "empty" {
            folder.create_dir(out);
        }
        let left = folder.names("").into_iter();
        let left: Vec<String> = left.filter(|name| name.starts_with(".hicp-")).collect();
        if signal == "-INT" && ended.code == 130 {
            assert_eq!(
                left, [""; 0],
                "an interrupted run removes its temporary files"
            );
        }
        for name in left {
            std::fs::remove_dir_all(folder.path(name)).unwrap();
        }
    }
    assert!(unfinished > 0);
    assert_eq!(folder.names(""), ["empty", "mine", "whole"]);
    assert!(folder.files("whole") == whole);
    // Leftover temporary folders do not disturb another run.
    folder.create_dir(".hicp-x.tmp");
    folder.command(command("empty")).exits(0);
    assert!(folder.files("empty") == whole);
    folder.command(command("mine")).fails(&["has 1 entries"]);
    assert_eq!(folder.bytes("mine/note"), b"the user's");
}
