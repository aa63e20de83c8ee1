//! `hybrid-icp bop sequence` on generated scenes.
//!
//! Fused poses are near the truth, images without the object are handled, and wrong inputs are
//! refused.

use crate::common::*;
use hicp_io::LengthUnit;
use hicp_io::bop::{Dataset, Rle, Scene, read_results};
use hybrid_icp::core::{Isometry3, se3};
use serde_json::{Value, json};

const IMAGES: usize = 7;
const SEQUENCE: &str = "bop sequence --dataset set --scene 1 --object 1 --output out.jsonl --init";
const CAMERAS: &str = "set/test/000001/scene_camera.json";
const INITIAL: &str = "set/initial_synthetic-test.csv";

/// Creates three equal cars on a table, seen along a path; only the pose selects one of them.
fn cars() -> Folder {
    let folder = Folder::new();
    folder.create_dir("meshes");
    let mesh = folder.path("meshes/car.ply");
    hicp_io::write_ply(mesh, &car(), LengthUnit::Meters).unwrap();
    let words = "bop generate --objects meshes --scenes 1 --images 7 --instances 3 --seed 5 --trajectory --out set";
    folder.command(words).exits(0);
    folder
}

#[track_caller]
fn sequence(folder: &Folder, init: &str, options: &str) -> Run {
    let words = format!("{SEQUENCE} {init} {options}");
    folder.command(words)
}

fn lines(folder: &Folder) -> Vec<Value> {
    folder.json_lines("out.jsonl")
}

fn scene(folder: &Folder) -> Scene {
    let dataset = Dataset::open(folder.path("set")).unwrap();
    dataset.scene("test", 1).unwrap()
}

/// Returns the instance whose perturbed pose comes first, and its true poses by image.
fn followed(folder: &Folder) -> (usize, Vec<Isometry3<f64>>) {
    let init = read_results(folder.path(INITIAL)).unwrap()[0].camera_from_object();
    let scene = scene(folder);
    let near = |pose: &Isometry3<f64>| (pose.translation.vector - init.translation.vector).norm();
    let truths = scene.ground_truth(0).unwrap();
    let (instance, _) = (0..)
        .zip(truths)
        .min_by(|(_, a), (_, b)| {
            near(&a.camera_from_object).total_cmp(&near(&b.camera_from_object))
        })
        .unwrap();
    let of_image = |im_id| scene.ground_truth(im_id).unwrap()[instance].camera_from_object;
    (instance, (0..7).map(of_image).collect())
}

fn off(pose: &Isometry3<f64>, truth: &Isometry3<f64>) -> (f64, f64) {
    se3::pose_distance(pose, truth)
}

#[test]
fn one_of_three_equal_cars_is_followed() {
    let folder = cars();
    let (instance, truths) = followed(&folder);
    // The camera moves, so the object moves in the camera frame.
    assert!(off(&truths[0], &truths[6]).1 > 0.05);
    for fuser in ["weighted-average", "filtering --uncertainty mve"] {
        let options = format!("--results fused.csv --fuser {fuser}");
        let told = sequence(&folder, INITIAL, &options).exits(0);
        assert_eq!(told.err, "");
        told.prints(&["7 images of scene 1", "mm fused"]);
        let lines = lines(&folder);
        assert_eq!(lines.len(), IMAGES);
        let fused = read_results(folder.path("fused.csv")).unwrap();
        for (im_id, (line, truth)) in lines.iter().zip(&truths).enumerate() {
            assert_eq!(
                (&line["im_id"], &line["obj_id"]),
                (&im_id.into(), &1.into())
            );
            assert_eq!(line["instance"], instance, "{line}");
            assert!(line["single"]["mve"].as_f64().unwrap() < 0.4, "{line}");
            assert_eq!(line["covariance"].as_array().unwrap().len(), 36);
            assert!(line["confidence"].as_f64().unwrap() > 0.5, "{line}");
            pose_of(&line["single"]);
            assert!(
                (fused[im_id].translation_mm()[2] - line["cam_t_m2c"][2].as_f64().unwrap()).abs()
                    < 1e-6
            );
            let (angle, distance) = off(&pose_of(line), truth);
            assert!(
                angle < 0.08 && distance < 0.004,
                "{im_id}: {angle} rad, {distance} m"
            );
        }
        assert_eq!(lines[6]["outcome"], "accepted");
        assert_improved(&pose_of(&lines[6]), &truths[6]);
    }
}

#[test]
fn detections_replace_the_ground_truth() {
    let folder = cars();
    sequence(&folder, INITIAL, "").exits(0);
    let expected = lines(&folder);
    let opened = scene(&folder);
    let mut detections = Vec::new();
    for im_id in 0..IMAGES as u32 {
        for instance in 0..3 {
            let rle = Rle::of_mask(&opened.read_visible_mask(im_id, instance).unwrap());
            detections.push(json!({
                "scene_id": 1, "image_id": im_id, "category_id": 1, "score": 1, "bbox": [0, 0, 9, 9],
                "segmentation": {"size": [480, 640], "counts": rle.counts()},
            }));
        }
    }
    let text = Value::from(detections.clone()).to_string();
    folder.write("found.json", text);
    folder.remove("set/test/000001/scene_gt.json");
    let refused = sequence(&folder, INITIAL, "").exits(1);
    refused.complains(&["scene_gt.json does not exist", "--detections"]);
    // Detections of another scene are the cause, not the initial pose.
    let text = Value::from(detections).to_string();
    folder.write(
        "other.json",
        text.replace("\"scene_id\":1", "\"scene_id\":2"),
    );
    let told = sequence(&folder, INITIAL, "--detections other.json").exits(0);
    let none = "warning: out.jsonl: none of its 7 images has a mask of the object: do not trust its \
                poses, and check that other.json has detections with scene_id 1 and category_id 1 for \
                its images\n";
    assert_eq!(told.err, none);
    sequence(&folder, INITIAL, "--detections found.json").exits(0);
    for (line, expected) in lines(&folder).iter().zip(&expected) {
        for key in ["cam_t_m2c", "covariance", "confidence", "single"] {
            assert_eq!(line[key], expected[key], "{key}");
        }
        assert_eq!(line.get("instance"), None);
    }
}

/// A dataset in the wrong unit is processed, but with warnings.
#[test]
fn impossible_scales_and_sizes_are_warned_of() {
    let folder = cars();
    let text = folder.read(CAMERAS);
    let scaled = |factor: f64| {
        folder.write(CAMERAS, &text);
        folder.change_json(CAMERAS, |value| {
            for camera in value.as_object_mut().unwrap().values_mut() {
                let scale = camera["depth_scale"].as_f64().unwrap();
                camera["depth_scale"] = (factor * scale).into();
            }
        });
        sequence(&folder, INITIAL, "").exits(0)
    };
    let none = format!(
        "warning: out.jsonl: an estimate is accepted in none of its 7 images: do not trust its poses, \
         and check {INITIAL}, that --init is in mm, --object and its mesh, and cam_K and depth_scale in scene_camera.json\n"
    );
    let none = none.as_str();
    assert_eq!(scaled(2.0).err, none);
    let told = scaled(10.0).err;
    let begin = "warning: object 1 in image 0 of scene 1: the median depth inside the mask is ";
    assert!(told.starts_with(begin) && told.ends_with(none), "{told}");
    assert_contains(
        &told,
        &[": check depth_scale in scene_camera.json, and that --init is in mm\n"],
    );
    assert_eq!(told.lines().count(), 2, "{told}");
    // A pose file has its own unit.
    folder.write("init.json", pose_json(&followed(&folder).1[0]).to_string());
    let told = sequence(&folder, "init.json", "").exits(0);
    told.complains(&["check depth_scale in scene_camera.json, and --init-unit\n"]);

    folder.write(CAMERAS, &text);
    folder.change_json("set/models/models_info.json", |value| {
        let diameter = value["1"]["diameter"].as_f64().unwrap();
        value["1"]["diameter"] = (1e3 * diameter).into();
    });
    let told = sequence(&folder, INITIAL, "").exits(0).err;
    let first = told.lines().next().unwrap();
    assert!(
        first.contains("models_info.json: object 1: the stated diameter is "),
        "{told}"
    );
    assert!(!told.contains("is in mm"), "{told}");
}

/// The motion of the camera has no other check than the images.
#[test]
fn wrong_camera_motions_are_warned_of() {
    let folder = cars();
    let text = folder.read(CAMERAS);
    let in_meters = |t: &mut Value| *t = (t.as_f64().unwrap() / 1e3).into();
    let inverted = |camera: &mut Value| {
        let r = camera["cam_R_w2c"].clone();
        for i in 0..9 {
            camera["cam_R_w2c"][i] = r[3 * (i % 3) + i / 3].clone();
        }
    };
    let meters = |camera: &mut Value| (0..3).for_each(|i| in_meters(&mut camera["cam_t_w2c"][i]));
    let changes: [&dyn Fn(&mut Value); 2] = [&meters, &inverted];
    for change in changes {
        folder.write(CAMERAS, &text);
        folder.change_json(CAMERAS, |value| {
            value.as_object_mut().unwrap().values_mut().for_each(change);
        });
        let told = sequence(&folder, INITIAL, "").exits(0);
        told.complains(&["of 7 images contradict", "cam_t_w2c", "stands still"]);
    }
}

#[test]
fn images_without_the_object_move_the_pose_with_the_camera() {
    let folder = cars();
    let (_, truths) = followed(&folder);
    let scene_dir = folder.path("set/test/000001");
    // Image 2 has no masks, image 4 has no depth.
    for instance in 0..3 {
        folder.remove(scene(&folder).visible_mask_path(2, instance));
    }
    folder.remove(scene_dir.join("depth/000004.png"));
    let told = sequence(&folder, INITIAL, "").exits(0);
    told.prints(&[
        "1  moved with the camera: no mask of the object",
        "no depth image",
    ]);
    let fused = lines(&folder);
    for (im_id, reason) in [(2, "mask"), (4, "depth")] {
        let (before, line) = (&fused[im_id - 1], &fused[im_id]);
        assert_eq!(
            (&line["outcome"], &line["single"]),
            (&"moved".into(), &Value::Null)
        );
        assert!(line["reason"].as_str().unwrap().contains(reason));
        // The pose moves like the true pose.
        let motion = truths[im_id] * truths[im_id - 1].inverse();
        let (angle, distance) = off(&pose_of(line), &(motion * pose_of(before)));
        assert!(angle < 1e-9 && distance < 1e-9, "{angle} rad, {distance} m");
    }
    assert_improved(&pose_of(&fused[6]), &truths[6]);

    // A damaged image has no estimate and is reported. The lines of the other images are written.
    folder.write(scene_dir.join("depth/000005.png"), "no image");
    sequence(&folder, INITIAL, "").fails(&["000005.png", "1 file could not be used"]);
    let damaged = lines(&folder);
    assert_eq!(
        (damaged.len(), &damaged[5]["outcome"]),
        (IMAGES, &"moved".into())
    );
    assert_eq!(damaged[3], fused[3]);
}

#[test]
fn missing_inputs_are_named() {
    let folder = cars();
    let refused = |init: &str, options: &str, parts: &[&str]| {
        sequence(&folder, init, options).fails(parts);
        assert!(!folder.path("out.jsonl").exists());
    };
    refused(INITIAL, "--first 99", &["--first 99", "scene_camera.json"]);
    refused("none.json", "", &["none.json"]);
    let words = SEQUENCE.replace("--object 1", "--object 8");
    let other = folder.command(format!("{words} {INITIAL}"));
    other.fails(&["--object 8", "scene_gt.json: 1"]);
    folder.write("other.csv", "scene_id,im_id,obj_id,score,R,t,time\n");
    refused(
        "other.csv",
        "",
        &["other.csv", "scene 1, image 0, object 1", "--first"],
    );
    sequence(&folder, INITIAL, "--fuser best").refuses(&["best", "most-confident"]);

    for key in ["cam_t_w2c", "cam_R_w2c"] {
        folder.change_json(CAMERAS, |value| {
            value["3"].as_object_mut().unwrap().remove(key);
        });
        refused(INITIAL, "", &["scene_camera.json", "$.3", key]);
    }
    // If the sequence starts after that image, the camera pose is not required.
    let pose = pose_json(&followed(&folder).1[4]);
    folder.write("init.json", pose.to_string());
    sequence(&folder, "init.json", "--first 4").exits(0);
    let of_json = lines(&folder);
    assert_eq!(of_json.len(), 3);
    let pose = followed(&folder).1[4];
    let (t, q) = (1e3 * pose.translation.vector, pose.rotation.coords);
    let text = format!("{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    folder.write("init.txt", text);
    sequence(&folder, "init.txt", "--first 4 --init-unit mm").exits(0);
    let apart = off(&pose_of(&lines(&folder)[2]), &pose_of(&of_json[2]));
    assert!(apart.0 < 1e-6 && apart.1 < 1e-6, "{apart:?}");
}
