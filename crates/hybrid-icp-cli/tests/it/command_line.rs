//! Help, usage errors and closed pipes.

use std::ffi::OsStr;
use std::process::Stdio;

use crate::common::*;

#[test]
fn help_texts_have_80_columns_and_the_important_words() {
    let folder = Folder::new();
    for (command, words) in [
        (
            "--help",
            &["Examples:", "Exit codes", "demo", "bop refine", "0.95"][..],
        ),
        (
            "demo --help",
            &["demo.png", "6.2 mm", "9.5", "--seed", "--noise"],
        ),
        (
            "refine --help",
            &[
                "Examples:",
                "cam_R_m2c",
                "MM_PER_UNIT",
                "kept_initial",
                "expected_error_mm",
                "OBJ, OFF, PLY or STL",
                "m, mm or cm",
                "cam_K",
            ],
        ),
        ("bop --help", &["refine"]),
        (
            "bop refine --help",
            &[
                "Example:",
                "mask_visib",
                "--detections",
                "--threads",
                "--no-time",
                "Exit codes",
            ],
        ),
        ("bop show --help", &["Example:", "--against"]),
        ("bop sequence --help", &["Example:", "--fuser"]),
        ("inspect --help", &["--unit", "--json"]),
        ("pipelines --help", &["Usage"]),
    ] {
        let help = folder.command(command).exits(0).out;
        for word in words {
            assert!(help.contains(word), "no {word:?} in {command}");
        }
        for line in help.lines() {
            assert!(line.chars().count() <= 80, "{command}: {line}");
        }
    }
}

#[test]
fn wrong_command_lines_are_usage_errors() {
    let folder = Folder::new();
    for (command, parts) in [
        ("", &["Usage"][..]),
        ("bop", &["Usage"]),
        ("refien", &["refien", "refine"]),
        (
            "demo --pipeline hybird",
            &[
                "--pipeline",
                "\"hybird\"",
                "did you mean \"hybrid\"",
                "nn-cascade-plane-point",
            ],
        ),
        (
            "refine --pipeline nn-point-to-plan",
            &["did you mean \"nn-point-to-plane\""],
        ),
        ("bop refine --pipeline x", &["--pipeline", "hybrid"]),
        (
            "refine",
            &[
                "--model",
                "--model-unit",
                "--depth",
                "--mask",
                "--camera",
                "--init",
            ],
        ),
        (
            "refine --model-unit inch",
            &["--model-unit", "inch", "m, mm or cm"],
        ),
        (
            "refine --depth-scale 0",
            &["--depth-scale", "'0'", "above 0"],
        ),
        (
            "refine --depth-scale -0.1",
            &["--depth-scale", "'-0.1'", "above 0"],
        ),
        (
            "refine --depth-scale NaN",
            &["--depth-scale", "'NaN'", "above 0"],
        ),
        (
            "refine --depth-scale inf",
            &["--depth-scale", "'inf'", "finite"],
        ),
        (
            "refine --depth-scale 1mm",
            &["--depth-scale", "'1mm'", "number"],
        ),
        ("bop refine --threads 0", &["--threads", "'0'", "1.."]),
        ("bop refine --threads -1", &["--threads", "'-1'", "1.."]),
        ("demo --object spoon", &["--object", "spoon", "mug"]),
        ("demo --noise -1", &["--noise", "'-1'", "0 to 50"]),
        ("demo --noise NaN", &["--noise", "NaN", "0 to 50"]),
    ] {
        let told = folder.command(command).refuses(parts);
        assert_eq!(told.out, "", "{command}");
    }
    assert!(folder.names("").is_empty());
}

#[test]
fn pipelines_are_listed_one_per_line() {
    let folder = Folder::new();
    let listed = folder.command("pipelines").exits(0).out;
    let names: Vec<_> = listed
        .lines()
        .map(|l| l.split_whitespace().next().unwrap())
        .collect();
    let presets = hybrid_icp::Preset::ALL;
    assert_eq!(names, presets.map(hybrid_icp::Preset::name));
    for (line, preset) in listed.lines().zip(presets) {
        assert!(line.ends_with(preset.summary()));
    }
}

/// The reader of the pipe closes it before the program writes.
#[test]
fn a_closed_pipe_is_not_an_error_and_the_work_is_done() {
    let scene = Scene::new()
        .without("--output")
        .with("--overlay", "overlay.png");
    let words = |text: &'static str| text.split(' ').map(OsStr::new).collect();
    let refine: Vec<_> = scene.words().collect();
    for (arguments, file) in [
        (words("demo"), Some("demo.png")),
        (words("pipelines"), None),
        (words("--help"), None),
        ([words("refine"), refine].concat(), Some("overlay.png")),
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut program = program(scene.root());
        program
            .args(&arguments)
            .stdout(writer)
            .stderr(Stdio::piped());
        let ended = program.spawn().unwrap().wait_with_output().unwrap();
        let run = Run::from(ended).exits(0);
        assert_eq!(run.err, "", "{arguments:?}");
        assert!(file.is_none_or(|file| scene.path(file).is_file()));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error() {
    let folder = Folder::new();
    let full = std::fs::File::options().write(true).open("/dev/full");
    let mut program = program(folder.root());
    program.arg("pipelines").stdout(full.unwrap());
    let run = Run::from(program.output().unwrap());
    run.fails(&["standard output"]);
}
