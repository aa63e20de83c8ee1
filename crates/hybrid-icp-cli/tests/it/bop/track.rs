//! `hybrid-icp bop track` on generated scenes with moving objects.

use std::fs;
use std::path::Path;

use crate::common::*;
use hicp_io::bop::{Dataset, read_results};
use hybrid_icp::core::se3;
use serde_json::Value;

const TRACK: &str = "bop track --dataset set --scene 1 --object 1 --output out.jsonl --init set/initial_synthetic-test.csv";

fn moving(images: u32) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let words = format!(
        "bop generate --scenes 1 --images {images} --instances 3 --seed 6 --moving --out set"
    );
    run(folder.path(), words.split(' ')).exits(0);
    folder
}

fn lines(folder: &Path) -> Vec<Value> {
    let text = fs::read_to_string(folder.join("out.jsonl")).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[test]
fn a_moving_mug_is_tracked_in_a_generated_scene() {
    let folder = moving(12);
    let folder = folder.path();
    let told = run(folder, format!("{TRACK} --results out.csv").split(' ')).exits(0);
    assert!(
        told.out.contains("12 images of scene 1, object 1"),
        "{}",
        told.out
    );
    assert!(
        told.out.contains("tracking") && told.out.contains("ms"),
        "{}",
        told.out
    );
    let scene = Dataset::open(folder.join("set"))
        .unwrap()
        .scene("test", 1)
        .unwrap();
    let truth = |image| scene.ground_truth(image).unwrap()[0].camera_from_object;
    assert!(se3::pose_distance(&truth(0), &truth(11)).1 > 0.01);
    let lines = lines(folder);
    assert_eq!(lines.len(), 12);
    for (image, line) in (0..).zip(&lines) {
        assert_eq!(
            (&line["im_id"], &line["obj_id"]),
            (&image.into(), &1.into())
        );
        let visible = scene.ground_truth_info(image).unwrap()[0]
            .visible_fraction
            .unwrap();
        let (_, distance) = se3::pose_distance(&pose_of(line), &truth(image));
        match line["state"].as_str().unwrap() {
            "tracking" => assert!(distance < 0.01, "{image}: {distance}"),
            state => assert!(
                ["doubtful", "lost"].contains(&state) && visible < 0.9,
                "{line}"
            ),
        }
        let shares = &line["evidence"];
        assert!(
            (0.0..=1.0).contains(&shares["agrees"].as_f64().unwrap()),
            "{line}"
        );
        assert!(
            (0.0..=1.0).contains(&line["score"].as_f64().unwrap()),
            "{line}"
        );
        assert!(line["time"].as_f64().unwrap() > 0.0);
    }
    let seen = lines.iter().filter(|line| line["state"] != "lost").count();
    assert_eq!(read_results(folder.join("out.csv")).unwrap().len(), seen);
}

#[test]
fn images_that_cannot_be_read_are_reported_and_have_a_predicted_pose() {
    let folder = moving(4);
    let folder = folder.path();
    fs::remove_file(folder.join("set/test/000001/depth/000002.png")).unwrap();
    let depth = folder.join("set/test/000001/depth/000002.png");
    for (damage, code) in [(None, 0), (Some("no image"), 1)] {
        if let Some(text) = damage {
            fs::write(&depth, text).unwrap();
        }
        let told = run(folder, TRACK.split(' ')).exits(code);
        assert!(told.err.contains("000002.png"), "{}", told.err);
        let lines = lines(folder);
        assert_eq!(lines.len(), 4);
        assert_ne!(lines[2]["state"], "tracking");
    }
}

#[test]
fn a_start_far_from_the_object_is_warned_of() {
    let folder = moving(2);
    let init = read_results(folder.path().join("set/initial_synthetic-test.csv")).unwrap();
    let pose = pose_json(&init[0].camera_from_object());
    fs::write(folder.path().join("init.json"), pose.to_string()).unwrap();
    let words = TRACK.replace("set/initial_synthetic-test.csv", "init.json --init-unit m");
    run(folder.path(), words.split(' ')).exits(0).complains(&[
        "tracked in none of its 2 images",
        "check init.json, and --init-unit",
    ]);
}

#[test]
fn wrong_inputs_of_tracking_are_refused() {
    let folder = moving(2);
    for (options, expected) in [
        ("--first 7", "--first 7 is not an image"),
        ("--fps 0", "--fps"),
        ("--fps nan", "--fps"),
        ("--init-unit m", "result files are in mm"),
    ] {
        let words = format!("{TRACK} {options}");
        let told = run(folder.path(), words.split(' '));
        assert!(told.err.contains(expected), "{options}: {}", told.err);
        assert_ne!(told.code, 0, "{options}");
    }
}
