//! The examples in all help texts run.
#![cfg(unix)]

use std::os::unix::fs::symlink;

use hicp_io::LengthUnit;
use serde_json::json;

use crate::common::*;

/// Returns the lines below a heading of a help text, up to the next empty line.
fn section<'a>(help: &'a str, heading: &str) -> Option<&'a str> {
    let (_, rest) = help.split_once(heading)?;
    rest.split("\n\n").next()
}

/// Returns the help texts of a command and of its subcommands.
fn help_texts(folder: &Folder, command: &str) -> Vec<(String, String)> {
    let help = folder.command(format!("{command} --help")).exits(0).out;
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
fn dataset(folder: &Folder) {
    let words = "bop generate --scenes 1 --images 2 --instances 3 --out bop/ycbv";
    folder.command(words).exits(0);
    let scenes = folder.path("bop/ycbv/test");
    std::fs::rename(scenes.join("000001"), scenes.join("000050")).unwrap();
    // Without targets, every visible instance is one.
    folder.remove("bop/ycbv/test_targets_bop19.json");
    let rows = folder.read("bop/ycbv/initial_synthetic-test.csv");
    folder.write("rows.csv", rows.replace("\n1,", "\n50,"));
    // A box in every image is a detection.
    let detection = |image: u32| {
        json!({"scene_id": 50, "image_id": image, "category_id": 1, "score": 0.5,
               "bbox": [200, 150, 240, 180]})
    };
    let detections = json!([detection(1), detection(2)]);
    folder.write("detections.json", detections.to_string());
}

#[test]
fn the_examples_of_all_help_texts_run() {
    let shared = Folder::new();
    dataset(&shared);
    let mut n_examples = 0;
    for (command, help) in help_texts(&shared, "") {
        let examples = section(&help, "\nExample:\n").or_else(|| section(&help, "\nExamples:\n"));
        let Some(examples) = examples else { continue };
        n_examples += 1;
        let scene = Scene::new();
        hicp_io::write_ply(scene.path("mug.ply"), &car(), LengthUnit::Millimeters).unwrap();
        std::fs::copy(scene.path("init.json"), scene.path("pose.json")).unwrap();
        hicp_io::write_rgb_png(scene.path("rgb.png"), 320, 240, &[90; 3 * 320 * 240]).unwrap();
        scene.create_dir("recording/depth");
        std::fs::copy(scene.path("depth.png"), scene.path("recording/depth/1.png")).unwrap();
        write_clouds(&scene, &truth());
        for name in ["bop", "detections.json"] {
            symlink(shared.path(name), scene.path(name)).unwrap();
        }
        for name in ["in.csv", "cosypose_ycbv-test.csv", "refined_ycbv-test.csv"] {
            std::fs::copy(shared.path("rows.csv"), scene.path(name)).unwrap();
        }
        // Fewer poses take less time.
        let script = examples.replace("--poses 30", "--poses 1");
        run_script(scene.root(), &script, &command);
    }
    assert!(n_examples >= 10, "{n_examples}");
}
