//! `hybrid-icp estimate` and `hybrid-icp bop estimate`.

use crate::common::*;
use hicp_io::bop::{ResultRow, read_results};
use hicp_io::{LengthUnit, read_mask_png};
use hicp_sim::Household;
use hybrid_icp::core::{DepthImage, Isometry3};
use hybrid_icp::score::ModelPoints;
use serde_json::json;

/// Runs `estimate` on a scene, and returns the run.
fn estimate(scene: &Scene, region: &str) -> Run {
    let words = format!(
        "estimate --model mesh.ply --model-unit m --depth depth.png --depth-scale 0.1 \
         --camera camera.json --output out.json --overlay overlay.png --trace trace.jsonl {region}"
    );
    scene.command(words)
}

#[test]
fn an_object_is_found_in_its_mask_or_box() {
    let scene = Scene::new();
    let mask = read_mask_png(scene.path("mask.png")).unwrap();
    let shown = mask.bounding_region();
    let (left, top) = (shown.u_min, shown.v_min);
    let bbox = format!("--bbox {left},{top},{}.5,{}", shown.width(), shown.height());
    for region in ["--mask mask.png", &bbox] {
        let told = estimate(&scene, region).exits(0);
        assert!(
            told.out.starts_with("estimated: confidence "),
            "{}",
            told.out
        );
        told.prints(&[", MVE 0.0"]);
        assert_eq!(told.err, "");
        let result = scene.json("out.json");
        assert!(error(CAR, &pose_of(&result), &truth()) < 0.001);
        assert_eq!(result["outcome"], "estimated");
        assert!(result["mve"].as_f64().unwrap() < 0.05);
        assert!(result.get("mve_initial").is_none());
        assert!(!result["trace"].as_array().unwrap().is_empty());
        let overlay = hicp_io::read_color(scene.path("overlay.png")).unwrap();
        let has = |color: [u8; 3]| overlay.pixels().contains(&color);
        assert!(overlay.width() == 640 && has([86, 180, 233]) && !has([230, 159, 0]));
        let told = scene.command("replay trace.jsonl").exits(0);
        told.prints(&["all equal"]);
    }
    let bbox = bbox.trim_start_matches("--bbox ");
    let refine = scene.without("--mask").with("--bbox", bbox);
    assert!(error(CAR, &pose_of(&refine.result()), &truth()) < 0.001);
}

#[test]
fn bounds_around_an_initial_pose_are_warned_of() {
    let region = "--mask mask.png --set max_rotation_degrees=30";
    let told = estimate(&Scene::new(), region).exits(0);
    told.warns(&["max_rotation_degrees has no effect", "no initial pose"]);
}

#[test]
fn an_estimate_that_finds_nothing_has_no_pose() {
    let scene = Scene::new();
    let told = estimate(&scene, "--bbox 0,0,20,20").exits(0);
    assert!(told.out.starts_with("found no pose: "), "{}", told.out);
    let found = scene.json("out.json");
    assert_eq!(found["outcome"], "not_found");
    assert!(found.get("cam_R_m2c").is_none() && found.get("cam_t_m2c").is_none());
    for (region, parts) in [
        ("", &["--bbox"][..]),
        ("--mask mask.png --bbox 1,2,3,4", &["--bbox", "--mask"]),
        ("--bbox 1,2,3", &["--bbox", "x,y,width,height"]),
        ("--bbox 1,2,3,-4", &["--bbox", "1 or more"]),
        ("--bbox 1,2,3,nan", &["--bbox", "1 or more"]),
        (
            "--bbox 0.1,0.1,0.4,0.4",
            &["--bbox", "in pixels", "1 or more"],
        ),
    ] {
        estimate(&scene, region).refuses(parts);
    }
    // The doctor needs an initial pose, so it is no advice.
    hicp_io::write_ply(scene.path("mesh.ply"), &car(), LengthUnit::Centimeters).unwrap();
    for region in ["--mask mask.png", "--bbox 60,30,200,180"] {
        let told = estimate(&scene, region).warns(&["--model-unit m"]);
        assert!(!told.err.contains("doctor"), "{}", told.err);
    }
    let dropped = DepthImage::from_meters(320, 240, vec![0.0; 320 * 240]).unwrap();
    hicp_io::write_depth_png(scene.path("depth.png"), &dropped, 0.1).unwrap();
    for (region, named) in [
        ("--mask mask.png", "mask.png"),
        ("--bbox 60,30,200,180", "--bbox"),
    ] {
        estimate(&scene, region).warns(&["no depth inside the mask", &format!("and {named}")]);
    }
    let reason = scene.json("out.json")["reason"].clone();
    let expected = "no depth was measured in the box, so that ";
    assert!(reason.as_str().unwrap().starts_with(expected), "{reason}");
    estimate(&scene, "--bbox 60,30,320,240")
        .warns(&["the box ends at (380, 270)", "not two corners"]);
    for bbox in ["320,0,9,9", "-9,0,9,9", "0,240,9,9"] {
        estimate(&scene, &format!("--bbox {bbox}"))
            .fails(&[bbox, "outside of the 320x240 image depth.png"]);
    }
}

fn bop_estimate(world: &World, options: &str) -> (Run, Vec<ResultRow>) {
    let words =
        format!("bop estimate --dataset . --detections found.json --output out.csv {options}");
    let run = world.command(words);
    let rows = read_results(world.path("out.csv")).unwrap_or_default();
    (run, rows)
}

/// Returns the ADI error in meters, because the car looks alike from the front and the back.
fn error(obj_id: u32, pose: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
    let object = match obj_id {
        CAR => Household::Car,
        _ => Household::Hammer,
    };
    ModelPoints::new(&object.model().unwrap()).adi(pose, truth)
}

#[test]
fn every_detection_becomes_a_row_with_its_score_and_its_time() {
    let world = World::new();
    // The last detection of every image has only a box.
    let mut found = world.detections(|index| index > 0);
    for place in 0..found.len() {
        let next = found.get(place + 1);
        if next.is_none_or(|next| next["image_id"] != found[place]["image_id"]) {
            found[place].as_object_mut().unwrap().remove("segmentation");
        }
    }
    world.write("found.json", json!(found).to_string());
    let (run, rows) = bop_estimate(&world, "--rows rows.csv");
    let run = run.exits(0);
    run.prints(&["10  estimated"]);
    assert_eq!((run.err.as_str(), rows.len()), ("", 10));
    let truths = world.truths.values().flatten();
    for ((row, detection), (id, truth)) in rows.iter().zip(&found).zip(truths) {
        assert_eq!(
            (row.obj_id, row.score),
            (*id, detection["score"].as_f64().unwrap())
        );
        assert!(row.time_s.unwrap() > 0.25);
        assert!(
            error(*id, &row.camera_from_object(), truth) < 0.004,
            "{row}"
        );
    }

    // Without times, the bytes do not depend on threads, shards or interruptions.
    let (run, _) = bop_estimate(&world, "--no-time --threads 1");
    run.exits(0);
    let output = || world.read("out.csv");
    let whole = output();
    let mut parts = String::new();
    for shard in ["1/2", "2/2"] {
        let (run, _) = bop_estimate(&world, &format!("--no-time --threads 2 --shard {shard}"));
        run.exits(0);
        let part = output();
        let (_, rows) = part.split_once('\n').unwrap();
        parts.push_str(if parts.is_empty() { &part } else { rows });
    }
    assert_eq!(parts, whole);

    // The rows of targets are those with the best scores.
    let targets = json!([{"scene_id": 12, "im_id": 40, "obj_id": CAR, "inst_count": 1}]);
    world.write("targets.json", targets.to_string());
    let (run, rows) = bop_estimate(&world, "--targets targets.json --rescore mve");
    run.exits(0);
    let truth = world.truths[&(12, 40)][2].1;
    assert!(rows.len() == 1 && rows[0].score > 0.9);
    assert!(error(CAR, &rows[0].camera_from_object(), &truth) < 0.004);

    // Detections without a pose are left out, and the rows count those that are written.
    found[0]["category_id"] = json!(ABSENT);
    found[1].as_object_mut().unwrap().remove("bbox");
    found[2]["segmentation"] = json!({"size": [1, 7], "counts": [0, 7]});
    found[4]["segmentation"] = json!({"size": [240, 320], "counts": [320 * 240]});
    world.write("found.json", json!(found).to_string());
    let (run, rows) = bop_estimate(&world, "--no-time --rows rows.csv");
    let run = run.fails(&["7x1", "320x240", "left out in out.csv"]);
    assert_eq!(rows.len(), 6);
    run.prints(&[
        "6  estimated",
        "1  left out: nothing measured inside",
        "1  left out: missing model (object 9)",
        "1  left out: no mask of the object",
        "1  left out: damaged file",
    ]);
    let status = world.read("rows.csv");
    let status: Vec<&str> = status.lines().collect();
    assert_eq!(status[1], "3,0,9,,left out: missing model,,,,");
    assert!(
        status[4].starts_with("3,40,2,0,estimated,"),
        "{}",
        status[4]
    );
}

#[test]
fn boxes_of_two_corners_are_warned_of() {
    let world = World::new();
    let mut found = world.detections(|_| true);
    found.truncate(1);
    found[0].as_object_mut().unwrap().remove("segmentation");
    found[0]["bbox"] = json!([100, 80, 300, 220]);
    world.write("found.json", json!(found).to_string());
    let parts = [
        "the box ends at (400, 300)",
        "1 of 1 images of scene 3",
        "check bbox in --detections",
    ];
    bop_estimate(&world, "--pipeline hybrid").0.warns(&parts);
    found[0]["bbox"] = json!([300, 220, -200, -140]);
    world.write("found.json", json!(found).to_string());
    let parts = ["found.json: no pose is estimated: check that bbox is"];
    bop_estimate(&world, "--pipeline hybrid").0.warns(&parts);
}
