//! Outputs take the place of nothing that the user had: what a shell has redirected, files of the dataset, rows of the input, each other.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod common;
#[path = "common/world.rs"]
mod world;

use std::fs::{File, read_to_string};
use std::os::unix::fs::{MetadataExt, symlink};
use std::path::Path;

use common::*;
use hicp_io::bop::write_results;
use serde_json::Value;
use world::*;

/// Runs the program with its standard output, or its standard error, in a file; returns what it said on the other one.
#[cfg(target_os = "linux")]
#[track_caller]
fn redirected(folder: &Path, words: &str, file: File, is_error: bool) -> Run {
    let mut command = program(folder);
    command.args(words.split(' '));
    let output = if is_error {
        command.stderr(file).output().unwrap()
    } else {
        command.stdout(file).output().unwrap()
    };
    Run {
        code: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

#[cfg(target_os = "linux")]
const REFINE: &str = "refine --model mesh.ply --model-unit m --depth depth.png --depth-scale 0.1 --mask mask.png \
                      --camera camera.json --init init.json --output";

/// `>> log` adds to the log, whichever of its names the output has.
#[cfg(target_os = "linux")]
#[test]
fn redirected_streams_are_added_to() {
    let scene = Scene::new();
    let folder = scene.folder.path();
    symlink("/dev/stdout", scene.path("link")).unwrap();
    for (name, is_error) in [
        ("/dev/stdout", false),
        ("/dev/fd/1", false),
        ("/proc/self/fd/1", false),
        ("link", false),
        ("/dev/stderr", true),
    ] {
        scene.write("log", "precious\n");
        let inode = std::fs::metadata(scene.path("log")).unwrap().ino();
        let log = File::options().append(true).open(scene.path("log"));
        redirected(folder, &format!("{REFINE} {name}"), log.unwrap(), is_error).exits(0);
        let text = read_to_string(scene.path("log")).unwrap();
        let added = text.strip_prefix("precious\n").unwrap();
        // What the program says on the stream comes after it and not over it.
        let end = added.rfind('}').unwrap() + 1;
        serde_json::from_str::<Value>(&added[..end]).unwrap();
        assert_eq!(added[end..].contains("MVE"), !is_error, "{name}: {added}");
        let after = std::fs::metadata(scene.path("log")).unwrap().ino();
        assert_eq!(after, inode, "{name}: replaced");
    }
    // Not opened for appending, as by `> log`: the position is the stream's own.
    let log = File::create(scene.path("log")).unwrap();
    redirected(folder, &format!("{REFINE} /dev/stdout"), log, false).exits(0);
    let text = read_to_string(scene.path("log")).unwrap();
    let end = text.rfind('}').unwrap() + 1;
    serde_json::from_str::<Value>(&text[..end]).unwrap();
    assert!(text[end..].contains("MVE"), "{text}");
    // Another descriptor, which a shell has opened.
    scene.write("log", "precious\n");
    let shell = format!("exec \"$0\" {REFINE} /dev/fd/3 3>>log");
    let mut command = std::process::Command::new("sh");
    command.args(["-c", &shell, env!("CARGO_BIN_EXE_hybrid-icp")]);
    let output = command.current_dir(folder).output().unwrap();
    assert!(output.status.success());
    let text = read_to_string(scene.path("log")).unwrap();
    serde_json::from_str::<Value>(text.strip_prefix("precious\n").unwrap()).unwrap();
    assert!(!names(folder).iter().any(|name| name.ends_with(".tmp")));
}

#[cfg(target_os = "linux")]
#[test]
fn redirected_streams_of_the_commands_over_datasets() {
    let world = World::new();
    let folder = world.folder.path();
    write_results(world.path("in.csv"), &world.rows()).unwrap();
    let add_to = |name: &str, words: &str| {
        let file = File::options().append(true).open(world.path(name));
        redirected(folder, words, file.unwrap(), false)
    };
    std::fs::write(world.path("log"), "precious\n").unwrap();
    add_to(
        "log",
        "bop eval --dataset . --results in.csv --json /dev/stdout",
    )
    .exits(0);
    let text = read_to_string(world.path("log")).unwrap();
    assert!(text.starts_with("precious\n{"), "{text}");

    // There is no journal beside a stream, so that whatever has its name is nobody's concern.
    symlink("/dev/stdout", world.path("link")).unwrap();
    std::fs::write(world.path("link.journal"), "my notes").unwrap();
    std::fs::write(world.path("log"), "").unwrap();
    let refine = "bop refine --dataset . --results in.csv --no-time --output";
    add_to("log", &format!("{refine} link")).exits(0);
    run(folder, format!("{refine} out.csv").split(' ')).exits(0);
    let rows = read_to_string(world.path("out.csv")).unwrap();
    let text = read_to_string(world.path("log")).unwrap();
    assert!(text.starts_with(&rows), "{text}");
    let notes = std::fs::read(world.path("link.journal")).unwrap();
    assert_eq!(notes, b"my notes");

    // In place is to replace the input; a stream would add to it.
    let input = std::fs::read(world.path("in.csv")).unwrap();
    add_to("in.csv", &format!("{refine} /dev/stdout"))
        .exits(1)
        .complains(&["--output and --results both name /dev/stdout"]);
    assert_eq!(std::fs::read(world.path("in.csv")).unwrap(), input);
}
