//! Malformed inputs of every command over datasets.
//!
//! Each is reported with its file, its line or key, and the expected value.

use std::path::Path;

use crate::common::*;
use hicp_io::bop::{ResultRow, write_results};
use hybrid_icp::core::{DepthImage, Mask};
use serde_json::json;

const REFINE: &str = "bop refine --dataset . --results in.csv --output out.csv";
const EVAL: &str = "bop eval --dataset . --results in.csv";
const SHOW: &str = "bop show --dataset . --scene 3 --image 0 --results in.csv --out show.png";

const HEADER: &str = "scene_id,im_id,obj_id,score,R,t,time";
const ROW: &str = "3,0,1,1,1 0 0 0 1 0 0 0 1,0 0 500,-1";

/// Creates a dataset with rows of its images.
fn dataset() -> World {
    let world = World::new();
    write_results(world.path("in.csv"), &world.rows()).unwrap();
    world
}

/// Runs commands, and asserts that they fail with all of these texts.
#[track_caller]
fn all_fail(world: &World, commands: &[&str], parts: &[&str]) {
    for command in commands {
        let told = world.command(command);
        told.fails(&["error: "]).complains(parts);
    }
}

/// Writes or replaces a file while a function runs.
fn with<C: AsRef<[u8]>>(path: &Path, content: C, then: impl FnOnce()) {
    let before = std::fs::read(path);
    std::fs::write(path, content).unwrap();
    then();
    match before {
        Ok(before) => std::fs::write(path, before).unwrap(),
        Err(_) => std::fs::remove_file(path).unwrap(),
    }
}

#[test]
fn an_unknown_object_names_the_model_that_is_missing() {
    let world = dataset();
    let pose = world.rows()[0].camera_from_object();
    write_results(world.path("in.csv"), &[ResultRow::new(3, 0, ABSENT, pose)]).unwrap();
    let refined = world.command(REFINE).exits(0);
    refined.prints(&["missing model (object 9)"]);
    all_fail(
        &world,
        &[SHOW],
        &["no model for object 9, expected", "obj_000009.ply"],
    );
    let target = json!([
        {"scene_id": 3, "im_id": 0, "obj_id": ABSENT, "inst_count": 1},
        {"scene_id": 3, "im_id": 0, "obj_id": CAR, "inst_count": 2},
    ]);
    world.write("asked.json", target.to_string());
    let words = format!("{EVAL} --targets asked.json");
    world.command(words).warns(&[
        "no model for object 9, expected",
        "obj_000009.ply",
        "left out",
    ]);
}

#[test]
fn images_name_the_file_and_what_it_should_be() {
    let world = dataset();
    let depth = world.depth_path(3, 0);
    let other = world.path("other.png");

    hicp_io::write_mask_png(&other, &Mask::full(320, 240)).unwrap();
    with(&depth, std::fs::read(&other).unwrap(), || {
        let parts = ["000003/depth/000000.png: found 8-bit", "expected 16-bit"];
        all_fail(&world, &[REFINE, EVAL, SHOW], &parts);
    });

    let small = DepthImage::from_meters(4, 3, vec![1.0; 12]).unwrap();
    hicp_io::write_depth_png(&other, &small, 0.1).unwrap();
    with(&depth, std::fs::read(&other).unwrap(), || {
        let parts = ["000000_00000", "320x240", "000000.png", "4x3", "expected"];
        all_fail(&world, &[REFINE, SHOW], &parts);
        let told = world.command(EVAL).exits(0);
        told.complains(&["warning: "]).complains(&parts);
    });

    // An image without depth counts as missing: `bop refine` and `bop eval` skip it, `bop show`
    // fails.
    let whole = std::fs::read(&depth).unwrap();
    std::fs::remove_file(&depth).unwrap();
    let parts = ["000003/depth/000000.png does not exist"];
    for command in [REFINE, EVAL] {
        let told = world.command(command).exits(0);
        told.complains(&["warning: "]).complains(&parts);
    }
    all_fail(&world, &[SHOW], &parts);
    std::fs::write(&depth, whole).unwrap();
}

/// The tests of `hicp-io` cover the other faults of each file.
#[test]
fn tables_json_and_codes_name_the_place() {
    let world = dataset();
    let detections = json!([
        {"scene_id": 3, "image_id": 0, "category_id": 1, "score": 0.5},
        {"scene_id": 3, "image_id": 0, "category_id": 1, "score": 0.5,
         "segmentation": {"size": [240, 320], "counts": [0, 70_000, 6_801]}},
    ]);
    let detected = [REFINE, SHOW].map(|command| format!("{command} --detections found.json"));
    let all = [REFINE, EVAL, SHOW];
    for (file, content, commands, parts) in [
        (
            "in.csv",
            format!(
                "{HEADER}\n{ROW}\n{}\n",
                ROW.replace("1 0 0 0 1", "1 0 0 0 nan")
            ),
            &all[..],
            &[
                "in.csv, line 3, column \"R\"",
                "nan",
                "9 finite numbers separated by spaces",
            ][..],
        ),
        (
            "test/000003/scene_gt.json",
            r#"{"0": 5}"#.to_owned(),
            &all,
            &["000003/scene_gt.json, $.0: found 5, expected an array"],
        ),
        (
            "models/models_info.json",
            r#"{"1": {"diameter": 100, "symmetries_continuous": 3}}"#.to_owned(),
            &all,
            &["models_info.json, $.1.symmetries_continuous: found 3, expected an array"],
        ),
        (
            "found.json",
            detections.to_string(),
            &detected.each_ref().map(String::as_str),
            &[
                "found.json, $[1].segmentation",
                "runs cover 76801 pixels",
                "expected 76800 for 320x240",
            ],
        ),
    ] {
        with(&world.path(file), content, || {
            all_fail(&world, commands, parts)
        });
        // A scene that cannot be read leaves the rows of the others.
        if file == "in.csv" {
            assert!(!world.path("out.csv").exists() && !world.path("show.png").exists());
        }
    }
}
