//! `hybrid-icp bop eval` on a small dataset.

mod damaged;
mod scores;

use crate::common::*;
use hicp_io::bop::{ResultRow, write_results};
use hybrid_icp::core::{DepthImage, Isometry3, Mask, Vector3};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// Creates a dataset in which every instance is a target.
fn dataset() -> World {
    let world = World::new();
    let mut targets = Vec::new();
    for ((scene, image), truths) in &world.truths {
        for id in [CAR, HAMMER] {
            let count = truths.iter().filter(|(of, _)| *of == id).count();
            if count > 0 {
                targets.push(
                    json!({"scene_id": scene, "im_id": image, "obj_id": id, "inst_count": count}),
                );
            }
        }
    }
    world.write("test_targets_bop19.json", Value::from(targets).to_string());
    world
}

/// Returns the true poses as rows, in another order than the ground truth.
fn truth_as_results(world: &World) -> Vec<ResultRow> {
    let mut rows = Vec::new();
    for ((scene, image), truths) in world.truths.iter().rev() {
        for (id, pose) in truths.iter().rev() {
            rows.push(ResultRow::new(*scene, *image, *id, *pose));
        }
    }
    rows
}

#[track_caller]
fn eval(world: &World, options: &str) -> Run {
    let fixed = "bop eval --dataset . --results in.csv --json out.json --errors errors.csv";
    world.command(format!("{fixed} {options}"))
}

/// Evaluates rows, asserts that there is no message, and returns the report.
#[track_caller]
fn report(world: &World, rows: &[ResultRow], options: &str) -> Value {
    write_results(world.path("in.csv"), rows).unwrap();
    let run = eval(world, options).exits(0);
    assert_eq!(run.err, "");
    world.json("out.json")
}

/// Returns AR, AR_VSD, AR_MSSD, AR_MSPD and the recall of AD.
fn recalls(part: &Value) -> [f64; 5] {
    ["ar", "ar_vsd", "ar_mssd", "ar_mspd", "ad_recall"].map(|key| part[key].as_f64().unwrap())
}
