//! Malformed inputs of every command over datasets.
//!
//! Each is reported with its file, its line or key, and the expected value.

use std::path::{Path, PathBuf};

use crate::common::*;
use crate::world::*;
use hicp_io::bop::{ResultRow, Rle, write_results};
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
        let told = run(world.folder.path(), command.split(' '));
        told.exits(1).complains(&["error: "]).complains(parts);
    }
}

/// Replaces the content of a file while a function runs.
fn with<C: AsRef<[u8]>>(path: &Path, content: C, then: impl FnOnce()) {
    let before = std::fs::read(path).unwrap();
    std::fs::write(path, content).unwrap();
    then();
    std::fs::write(path, before).unwrap();
}

#[test]
fn result_files_name_line_and_column() {
    let world = dataset();
    let table = |from: &str, to: &str| {
        let row = ROW.replace(from, to);
        assert_ne!(row, ROW);
        format!("{HEADER}\n{ROW}\n{row}\n")
    };
    for (text, parts) in [
        (
            format!("{}\n{ROW}\n", HEADER.replace(",score", "")),
            &["in.csv, line 1", "\"score\" appears 0 times"][..],
        ),
        (table(",-1", ""), &["in.csv, line 3", "6", "7"]),
        (
            table("1,1 0", "NaN,1 0"),
            &[
                "in.csv, line 3, column \"score\"",
                "\"NaN\"",
                "finite number",
            ],
        ),
        (
            table("1 0 0 0 1 0 0 0 1", "1 0 0 0 nan 0 0 0 1"),
            &[
                "in.csv, line 3, column \"R\"",
                "nan",
                "9 finite numbers separated by spaces",
            ],
        ),
        (
            table("1 0 0 0 1 0 0 0 1", "1 00 0 1 0 0 0 1"),
            &[
                "in.csv, line 3, column \"R\"",
                "9 finite numbers separated by spaces",
            ],
        ),
        (
            table("0 0 500", "00500"),
            &[
                "in.csv, line 3, column \"t\"",
                "\"00500\"",
                "3 finite numbers separated by spaces",
            ],
        ),
    ] {
        std::fs::write(world.path("in.csv"), text).unwrap();
        all_fail(&world, &[REFINE, EVAL, SHOW], parts);
    }
    assert!(!world.path("out.csv").exists() && !world.path("show.png").exists());
}

#[test]
fn an_unknown_object_names_the_model_that_is_missing() {
    let world = dataset();
    let pose = world.rows()[0].camera_from_object();
    write_results(world.path("in.csv"), &[ResultRow::new(3, 0, ABSENT, pose)]).unwrap();
    let refined = run(world.folder.path(), REFINE.split(' ')).exits(0);
    assert!(
        refined.out.contains("missing model (object 9)"),
        "{}",
        refined.out
    );
    all_fail(
        &world,
        &[SHOW],
        &["no model for object 9, expected", "obj_000009.ply"],
    );
    let target = json!([
        {"scene_id": 3, "im_id": 0, "obj_id": ABSENT, "inst_count": 1},
        {"scene_id": 3, "im_id": 0, "obj_id": CAR, "inst_count": 2},
    ]);
    std::fs::write(world.path("asked.json"), target.to_string()).unwrap();
    let words = format!("{EVAL} --targets asked.json");
    run(world.folder.path(), words.split(' '))
        .exits(0)
        .complains(&[
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
        let told = run(world.folder.path(), EVAL.split(' ')).exits(0);
        told.complains(&["warning: "]).complains(&parts);
    });

    // An image without depth counts as missing: `bop refine` and `bop eval` skip it, `bop show`
    // fails.
    let whole = std::fs::read(&depth).unwrap();
    std::fs::remove_file(&depth).unwrap();
    let parts = ["000003/depth/000000.png does not exist"];
    for command in [REFINE, EVAL] {
        let told = run(world.folder.path(), command.split(' ')).exits(0);
        told.complains(&["warning: "]).complains(&parts);
    }
    all_fail(&world, &[SHOW], &parts);
    std::fs::write(&depth, whole).unwrap();
}

#[test]
fn json_names_the_key() {
    let world = dataset();
    let scene = |name: &str| -> PathBuf { world.scene(3).join(name) };
    for (path, content, parts) in [
        (
            scene("scene_gt.json"),
            r#"{"0": 5}"#.to_owned(),
            &["000003/scene_gt.json, $.0: found 5, expected an array"][..],
        ),
        (
            scene("scene_camera.json"),
            r#"{"0": {"cam_K": 400, "depth_scale": 0.1}}"#.to_owned(),
            &["000003/scene_camera.json, $.0.cam_K: found 400, expected an array of 9 numbers"],
        ),
        (
            scene("scene_camera.json"),
            BOP_CAMERA
                .replace("0.1", "\"mm\"")
                .replacen('{', "{\"0\": {", 1)
                + "}",
            &["000003/scene_camera.json, $.0.depth_scale: found the text \"mm\""],
        ),
        (
            scene("scene_gt.json"),
            json!({"0": [{"obj_id": 1, "cam_R_m2c": 1, "cam_t_m2c": [0, 0, 500]}]}).to_string(),
            &["000003/scene_gt.json, $.0[0].cam_R_m2c: found 1, expected an array of 9 numbers"],
        ),
    ] {
        with(&path, content, || {
            all_fail(&world, &[REFINE, EVAL, SHOW], parts)
        });
    }
    std::fs::write(
        world.path("models/models_info.json"),
        r#"{"1": {"diameter": 100, "symmetries_continuous": 3}}"#,
    )
    .unwrap();
    let parts = ["models_info.json, $.1.symmetries_continuous: found 3, expected an array"];
    all_fail(&world, &[REFINE, EVAL, SHOW], &parts);
}

#[test]
fn run_length_codes_name_the_detection() {
    let world = dataset();
    let full = Rle::of_mask(&Mask::full(320, 240));
    let overrun = Rle::from_counts(320, 241, vec![0, 320 * 241]).unwrap();
    assert_eq!(full.counts(), [0, 76_800]);
    for (counts, parts) in [
        (
            json!([0, 70_000, 6_801]),
            &["runs cover 76801 pixels", "expected 76800 for 320x240"][..],
        ),
        (json!([u32::MAX, u32::MAX]), &["expected 76800 for 320x240"]),
        (
            json!(overrun.to_compressed()),
            &["runs cover 77120 pixels", "expected 76800"],
        ),
        (
            json!(full.to_compressed() + "o"),
            &["run 2 of the compressed code", "cut off"],
        ),
        (
            json!("~"),
            &["character '~' at byte 0", "expected '0' to 'o'"],
        ),
        (json!(7), &["found 7", "expected"]),
        (json!([0, -76_800]), &["found -76800", "expected"]),
    ] {
        let found = json!([
            {"scene_id": 3, "image_id": 0, "category_id": 1, "score": 0.5},
            {"scene_id": 3, "image_id": 0, "category_id": 1, "score": 0.5,
             "segmentation": {"size": [240, 320], "counts": counts}},
        ]);
        std::fs::write(world.path("found.json"), found.to_string()).unwrap();
        let commands = [REFINE, SHOW].map(|command| format!("{command} --detections found.json"));
        for command in &commands {
            all_fail(&world, &[command], &["found.json, $[1].segmentation"]);
            all_fail(&world, &[command], parts);
        }
    }
}
