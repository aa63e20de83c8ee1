//! The examples in all help texts run.
#![cfg(unix)]

use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use hicp_io::LengthUnit;

use serde_json::json;

use crate::common::*;

/// Returns the lines below a heading of a help text, up to the next empty line.
fn section<'a>(help: &'a str, heading: &str) -> Option<&'a str> {
    let (_, rest) = help.split_once(heading)?;
    rest.split("\n\n").next()
}

/// Returns the help texts of a command and of its subcommands.
fn help_texts(folder: &Path, command: &str) -> Vec<(String, String)> {
    let words = command.split_whitespace().chain(["--help"]);
    let help = run(folder, words).exits(0).out;
    let list = section(&help, "\nCommands:\n").unwrap_or_default();
    let names = list.lines().filter_map(|line| line.strip_prefix("  "));
    // The other lines continue a description.
    let names = names.filter(|line| !line.starts_with([' ', '\t']));
    let names = names.filter_map(|line| line.split_whitespace().next());
    let below = names.filter(|name| *name != "help");
    let below = below.flat_map(|name| help_texts(folder, &format!("{command} {name}")));
    let below: Vec<_> = below.collect();
    [(command.to_owned(), help)]
        .into_iter()
        .chain(below)
        .collect()
}

/// Creates the dataset of the examples, with one scene of the number that they name.
fn dataset(folder: &Path) {
    let words = "bop generate --scenes 1 --images 2 --instances 3 --out bop/ycbv";
    run(folder, words.split(' ')).exits(0);
    let root = folder.join("bop/ycbv");
    std::fs::rename(root.join("test/000001"), root.join("test/000050")).unwrap();
    // Without targets, every visible instance is one.
    std::fs::remove_file(root.join("test_targets_bop19.json")).unwrap();
    let rows = std::fs::read_to_string(root.join("initial_synthetic-test.csv")).unwrap();
    std::fs::write(folder.join("rows.csv"), rows.replace("\n1,", "\n50,")).unwrap();
    // A box in every image is a detection.
    let detection = |image: u32| {
        json!({"scene_id": 50, "image_id": image, "category_id": 1, "score": 0.5,
               "bbox": [200, 150, 240, 180]})
    };
    let detections = json!([detection(1), detection(2)]);
    std::fs::write(folder.join("detections.json"), detections.to_string()).unwrap();
}

#[test]
fn the_examples_of_all_help_texts_run() {
    let shared = tempfile::tempdir().unwrap();
    dataset(shared.path());
    let program = Path::new(env!("CARGO_BIN_EXE_hybrid-icp"));
    let program = program.parent().unwrap().display();
    let path = format!("{program}:{}", std::env::var("PATH").unwrap());
    let mut n_examples = 0;
    for (command, help) in help_texts(shared.path(), "") {
        let examples = section(&help, "\nExample:\n").or_else(|| section(&help, "\nExamples:\n"));
        let Some(examples) = examples else { continue };
        n_examples += 1;
        let scene = Scene::new();
        hicp_io::write_ply(scene.path("mug.ply"), &car(), LengthUnit::Millimeters).unwrap();
        std::fs::copy(scene.path("init.json"), scene.path("pose.json")).unwrap();
        hicp_io::write_rgb_png(scene.path("rgb.png"), 320, 240, &[90; 3 * 320 * 240]).unwrap();
        write_clouds(scene.folder.path(), &truth());
        for name in ["bop", "detections.json"] {
            symlink(shared.path().join(name), scene.path(name)).unwrap();
        }
        for name in ["in.csv", "cosypose_ycbv-test.csv", "refined_ycbv-test.csv"] {
            std::fs::copy(shared.path().join("rows.csv"), scene.path(name)).unwrap();
        }
        // Fewer poses take less time.
        let script = examples.replace("--poses 30", "--poses 1");
        let mut shell = Command::new("sh");
        shell.args(["-e", "-c", &script]).env("PATH", &path);
        let output = shell.current_dir(scene.folder.path()).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{command}: {script}\n{errors}");
    }
    assert!(n_examples >= 9, "{n_examples}");
}
