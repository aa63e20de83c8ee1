//! Malformed inputs of every command over datasets.
//!
//! Each is reported with its file, its line or key, and the expected value.

use std::path::Path;

use crate::common::*;
use hicp_io::bop::write_results;
use hybrid_icp::core::{DepthImage, Mask};

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
}

/// The tests of `hicp-io` cover the other faults of each file.
#[test]
fn tables_and_json_name_the_place() {
    let world = dataset();
    for (file, content, parts) in [
        (
            "in.csv",
            format!(
                "{HEADER}\n{ROW}\n{}\n",
                ROW.replace("1 0 0 0 1", "1 0 0 0 nan")
            ),
            &[
                "in.csv, line 3, column \"R\"",
                "nan",
                "9 finite numbers separated by spaces",
            ][..],
        ),
        (
            "test/000003/scene_gt.json",
            r#"{"0": 5}"#.to_owned(),
            &["000003/scene_gt.json, $.0: found 5, expected an array"],
        ),
        (
            "models/models_info.json",
            r#"{"1": {"diameter": 100, "symmetries_continuous": 3}}"#.to_owned(),
            &["models_info.json, $.1.symmetries_continuous: found 3, expected an array"],
        ),
    ] {
        with(&world.path(file), content, || {
            all_fail(&world, &[REFINE, EVAL, SHOW], parts)
        });
        // A scene that cannot be read leaves the rows of the others.
        if file == "in.csv" {
            assert!(!world.path("out.csv").exists() && !world.path("show.png").exists());
        }
    }
}
