//! `hybrid-icp bop refine`: the choice of rows and of their masks.

use crate::common::*;
use hicp_io::bop::{ResultRow, read_results, write_results};
use hybrid_icp::core::{Isometry3, Mask};
use serde_json::{Value, json};

#[test]
fn without_segmentation_rows_are_refined_in_the_box_around_their_pose() {
    let world = World::new();
    let mut rows = world.rows();
    let refinable = rows.len();
    let pose = rows[0].camera_from_object();
    // Nothing was measured around the first pose, and the second is behind the camera.
    for z in [3.0, -3.0] {
        let moved = Isometry3::translation(0.0, 0.0, z) * pose;
        rows.push(ResultRow::new(3, 0, CAR, moved));
    }
    let (run, refined) = world.refine(&rows, "--mask none --no-time");
    let run = run.exits(0);
    assert_eq!(run.err, "");
    run.prints(&["10  refined", "2  kept: nothing measured about the pose"]);
    for (before, after) in rows.iter().zip(&refined).take(refinable) {
        world.assert_refined(before, after);
    }
    let whole = world.bytes("out.csv");

    // Neither masks nor ground truth are read.
    for scene in [3, 12] {
        std::fs::remove_dir_all(world.scene(scene).join("mask_visib")).unwrap();
        world.remove(world.scene(scene).join("scene_gt.json"));
    }
    world.refined(&rows, "--mask none --no-time --threads 2");
    assert_eq!(world.bytes("out.csv"), whole);
    world
        .run("--mask none --detections found.json")
        .refuses(&["--mask", "--detections"]);
}

#[test]
fn rows_of_one_object_compete_for_its_masks() {
    let world = World::new();
    let cars: Vec<Isometry3<f64>> = world.truths[&(3, 0)].iter().map(|(_, p)| *p).collect();
    let nearest = |row: &ResultRow| {
        let at = row.camera_from_object().translation.vector;
        let distance = |car: &Isometry3<f64>| (at - car.translation.vector).norm();
        usize::from(distance(&cars[1]) < distance(&cars[0]))
    };
    let good = ResultRow::new(3, 0, CAR, nearby(&cars[0], 1));
    // The estimate of the second car moves toward the first, until alone it would use that one's
    // mask.
    let astray = (10..40).map(|step| {
        let toward = cars[0].translation.vector - cars[1].translation.vector;
        let shift = f64::from(step) * 0.025 * toward;
        let moved = Isometry3::translation(shift.x, shift.y, shift.z) * cars[1];
        ResultRow::new(3, 0, CAR, moved)
    });
    let astray = astray.into_iter().find(|row| {
        let alone = world.refined(std::slice::from_ref(row), "--no-time");
        nearest(&alone[0]) == 0
    });
    let astray = astray.unwrap();
    for rows in [[good.clone(), astray.clone()], [astray, good]] {
        let refined = world.refined(&rows, "--no-time");
        // Each estimate has its own mask.
        let mut found: Vec<usize> = refined.iter().map(nearest).collect();
        found.sort_unstable();
        assert_eq!(found, [0, 1]);
    }

    // Several estimates of one instance share its mask.
    let hammer = world.truths[&(3, 40)][1].1;
    let rows = [1, 2, 3].map(|seed| ResultRow::new(3, 40, HAMMER, nearby(&hammer, seed)));
    let (run, refined) = world.refine(&rows, "--no-time");
    assert!(run.exits(0).out.contains("3  refined"));
    for (before, after) in rows.iter().zip(&refined) {
        world.assert_refined(before, after);
    }
}

#[test]
fn the_best_rows_of_every_object_are_kept() {
    let world = World::new();
    let mut rows = Vec::new();
    for ((scene, image), truths) in &world.truths {
        for (place, (id, pose)) in truths.iter().enumerate() {
            for seed in 0..3_u32 {
                let mut row = ResultRow::new(*scene, *image, *id, nearby(pose, seed.into()));
                row.score = f64::from(seed) + 0.1 * place as f64;
                rows.push(row);
            }
        }
    }
    write_results(world.path("in.csv"), &rows).unwrap();
    let kept = |options: &str| {
        world.run(options).exits(0);
        let rows = read_results(world.path("out.csv")).unwrap();
        let key = |row: &ResultRow| (row.scene_id, row.im_id, row.obj_id, row.score);
        rows.iter().map(key).collect::<Vec<_>>()
    };
    let best = kept("--top-k 1");
    let expected = [
        (3, 0, CAR, 2.1),
        (3, 40, HAMMER, 2.1),
        (3, 40, CAR, 2.2),
        (12, 0, CAR, 2.1),
        (12, 40, HAMMER, 2.1),
        (12, 40, CAR, 2.2),
    ];
    assert_eq!(best, expected);
    let targets = json!([
        {"scene_id": 12, "im_id": 0, "obj_id": CAR, "inst_count": 2},
        {"scene_id": 3, "im_id": 40, "obj_id": HAMMER, "inst_count": 1},
        {"scene_id": 3, "im_id": 40, "obj_id": ABSENT, "inst_count": 1},
    ]);
    world.write("targets.json", targets.to_string());
    let of_targets = [(3, 40, HAMMER, 2.1), (12, 0, CAR, 2.0), (12, 0, CAR, 2.1)];
    assert_eq!(kept("--targets targets.json"), of_targets);
    let both = kept("--targets targets.json --top-k 1");
    assert_eq!(both, [of_targets[0], of_targets[2]]);
    // Shards divide the remaining rows.
    let mut parts = kept("--top-k 1 --shard 1/2");
    parts.extend(kept("--top-k 1 --shard 2/2"));
    assert_eq!(parts, expected);

    world.run("--top-k 0").refuses(&["--top-k", "1.."]);
    world
        .run("--targets out.csv")
        .fails(&["--output", "--targets", "overwritten"]);
    world.write("targets.json", "[7]");
    world
        .run("--targets targets.json")
        .fails(&["targets.json", "$[0]", "scene_id"]);
}

/// Replaces the cameras of every image.
fn set_cameras(world: &World, camera: &Value) {
    for scene in [3, 12] {
        let cameras = json!({"0": camera, "40": camera});
        let path = world.scene(scene).join("scene_camera.json");
        world.write(path, cameras.to_string());
    }
}

#[test]
fn layouts_of_other_datasets_give_the_same_bytes() {
    let world = World::new();
    let rows = world.rows();
    world.refined(&rows, "--no-time");
    let output = || world.bytes("out.csv");
    let expected = output();

    let model = |kind: &str, parameters: &[f64]| {
        json!({"depth_scale": 0.1, "cam_model": {
            "label": "camera-rgb", "projection_model_type": kind, "projection_params": parameters,
            "image_width": 320, "image_height": 240,
        }})
    };
    let pinhole = [400.0, 402.0, 161.5, 118.0];
    set_cameras(&world, &model("PinholePlane", &pinhole));
    world.refined(&rows, "--no-time");
    assert_eq!(output(), expected);
    let mut large = model("PinholePlane", &pinhole);
    large["cam_model"]["image_width"] = json!(1408);
    for (camera, parts) in [
        (
            model("CameraModelType.FISHEYE624", &[0.0; 15]),
            &[
                "$.0.cam_model.projection_model_type",
                "FISHEYE624",
                "undistorted",
            ][..],
        ),
        (large, &["$.0.cam_model", "1408x240", "320x240"]),
        (json!({"depth_scale": 0.1}), &["$.0", "cam_K"]),
    ] {
        set_cameras(&world, &camera);
        let (run, kept) = world.refine(&rows, "--no-time");
        run.fails(&["scene_camera.json"]).complains(parts);
        assert!(rows.iter().zip(&kept).all(|(a, b)| same_pose(a, b)));
    }
    set_cameras(&world, &serde_json::from_str(BOP_CAMERA).unwrap());

    for split in ["test_primesense", "train_pbr"] {
        std::fs::rename(world.path("test"), world.path(split)).unwrap();
        world.run("--no-time").fails(&["split is missing", "test"]);
        let words = format!(
            "bop refine --dataset . --split {split} --results in.csv --output out.csv --no-time"
        );
        world.command(words).exits(0);
        assert_eq!(output(), expected);
        std::fs::rename(world.path(split), world.path("test")).unwrap();
    }

    // Some datasets have gray images instead of color images. The evaluation checks their size.
    let gray = world.scene(3).join("gray");
    world.create_dir(&gray);
    hicp_io::write_mask_png(gray.join("000000.png"), &Mask::full(320, 240)).unwrap();
    hicp_io::write_mask_png(gray.join("000040.png"), &Mask::full(32, 24)).unwrap();
    let told = world
        .command("bop eval --dataset . --results in.csv")
        .exits(0);
    let told = told.complains(&["gray/000040.png is 32x24 pixels, expected 320x240"]);
    assert!(!told.err.contains("gray/000000.png"), "{}", told.err);
}

#[test]
fn a_sensor_of_several_gives_the_same_bytes() {
    let world = World::new();
    let rows = world.rows();
    world.refined(&rows, "--no-time");
    let whole = world.bytes("out.csv");
    for scene in [3, 12] {
        for name in world.names(world.scene(scene)) {
            let (stem, extension) = name
                .split_once('.')
                .map_or((&*name, ""), |(s, _)| (s, ".json"));
            let to = world.scene(scene).join(format!("{stem}_cam1{extension}"));
            std::fs::rename(world.scene(scene).join(&name), to).unwrap();
        }
    }
    let (run, _) = world.refine(&rows, "--no-time --sensor cam1");
    assert_eq!(run.exits(0).err, "");
    assert_eq!(world.bytes("out.csv"), whole);
    let (run, _) = world.refine(&rows, "");
    run.fails(&[
        "scene_camera.json",
        "file of cameras (or --sensor cam1) is missing",
    ]);
}
