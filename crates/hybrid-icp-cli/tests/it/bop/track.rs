//! `hybrid-icp bop track` on generated scenes with moving objects.

use crate::common::*;
use hicp_io::bop::{Dataset, read_results};
use hybrid_icp::core::se3;

const TRACK: &str = "bop track --dataset set --scene 1 --object 1 --output out.jsonl --init set/initial_synthetic-test.csv";

fn moving(images: u32) -> Folder {
    let folder = Folder::new();
    let words = format!(
        "bop generate --scenes 1 --images {images} --instances 3 --seed 6 --moving --out set"
    );
    folder.command(words).exits(0);
    folder
}

#[test]
fn a_moving_mug_is_tracked_in_a_generated_scene() {
    let folder = moving(12);
    let told = folder
        .command(format!("{TRACK} --results out.csv"))
        .exits(0);
    let parts = ["12 images of scene 1, object 1", "tracking", "ms"];
    told.prints(&parts);
    let scene = Dataset::open(folder.path("set"))
        .unwrap()
        .scene("test", 1)
        .unwrap();
    let truth = |image| scene.ground_truth(image).unwrap()[0].camera_from_object;
    assert!(se3::pose_distance(&truth(0), &truth(11)).1 > 0.01);
    let lines = folder.json_lines("out.jsonl");
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
        for share in [&line["evidence"]["agrees"], &line["score"]] {
            assert!((0.0..=1.0).contains(&share.as_f64().unwrap()), "{line}");
        }
        assert!(line["time"].as_f64().unwrap() > 0.0);
    }
    let seen = lines.iter().filter(|line| line["state"] != "lost");
    let scores = seen.map(|line| match line["state"] == "tracking" {
        true => line["score"].as_f64().unwrap(),
        false => 0.0,
    });
    let rows = read_results(folder.path("out.csv")).unwrap();
    assert!(rows.iter().map(|row| row.score).eq(scores));
    // On the standard output, nothing follows the lines.
    let words = TRACK.replace("out.jsonl", "-");
    let told = folder.command(words).exits(0);
    assert_eq!(told.out.lines().count(), 12);
    told.complains(&parts);
}

#[test]
fn images_that_cannot_be_read_are_reported_and_have_a_predicted_pose() {
    let folder = moving(4);
    let depth = "set/test/000001/depth/000002.png";
    folder.remove(depth);
    for (damage, code) in [(None, 0), (Some("no image"), 1)] {
        if let Some(text) = damage {
            folder.write(depth, text);
        }
        let told = folder.command(TRACK).exits(code);
        assert_contains(&told.err, &["000002.png"]);
        let lines = folder.json_lines("out.jsonl");
        assert_eq!(lines.len(), 4);
        assert_ne!(lines[2]["state"], "tracking");
    }
    for image in 0..4 {
        folder.remove(format!("set/test/000001/depth/{image:06}.png"));
    }
    folder
        .command(TRACK)
        .fails(&["the depth of no image could be read", "out.jsonl"]);
    assert_eq!(folder.json_lines("out.jsonl").len(), 4);
}

#[test]
fn a_start_far_from_the_object_is_warned_of() {
    let folder = moving(2);
    let init = read_results(folder.path("set/initial_synthetic-test.csv")).unwrap();
    let pose = pose_json(&init[0].camera_from_object());
    folder.write("init.json", pose.to_string());
    let info = "set/models/models_info.json";
    folder.change_json(info, |value| value["1"]["diameter"] = 1.into());
    let words = TRACK.replace("set/initial_synthetic-test.csv", "init.json --init-unit m");
    folder.command(words).warns(&[
        "models_info.json: object 1: the stated diameter is 0.0010 m",
        "tracked in none of its 2 images",
        "check init.json, --init-unit, --object and its mesh, and cam_K and depth_scale",
    ]);
}

/// If the time between two images is wrong, a filter lags behind the object.
#[test]
fn the_pose_does_not_lag_behind_if_the_rate_is_wrong() {
    let folder = moving(8);
    let told = folder.command(format!("{TRACK} --fps 300000"));
    told.warns(&["--fps is 300000, expected the number of images per second, at most 1000"]);
    let dataset = Dataset::open(folder.path("set")).unwrap();
    let scene = dataset.scene("test", 1).unwrap();
    for (image, line) in (0..).zip(folder.json_lines("out.jsonl")) {
        let truth = scene.ground_truth(image).unwrap()[0].camera_from_object;
        let (_, distance) = se3::pose_distance(&pose_of(&line), &truth);
        assert!(distance < 0.003, "{image}: {distance}");
    }
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
        let told = folder.command(words);
        assert!(told.err.contains(expected), "{options}: {}", told.err);
        assert_ne!(told.code, 0, "{options}");
    }
}
