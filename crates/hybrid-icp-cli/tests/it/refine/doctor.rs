//! `hybrid-icp doctor`.

use std::ffi::OsString;

use hicp_io::{LengthUnit, pose_to_bop};
use hybrid_icp::core::{DepthImage, Isometry3, Quaternion, Translation3, TriMesh, UnitQuaternion};
use serde_json::{Value, json};

use crate::common::*;

/// Runs `doctor` with the arguments of a scene, and returns its text and its JSON.
fn examine(scene: &Scene) -> (String, Value) {
    let arguments = scene.arguments.iter().cloned();
    let printed = arguments.filter(|(option, _)| *option != "--output");
    let words = printed.flat_map(|(option, value)| [option.into(), value]);
    let mut words: Vec<OsString> = std::iter::once("doctor".into()).chain(words).collect();
    let text = run(scene.root(), &words).exits(0).out;
    words.push("--json".into());
    (text, run(scene.root(), &words).exits(0).json())
}

/// Asserts that a fault is named first, with an option that corrects it.
#[track_caller]
fn names(scene: &Scene, fault: &str, option: Option<&str>) {
    let (text, json) = examine(scene);
    let first = &json["faults"][0];
    assert_eq!(first["fault"], fault, "{text}");
    assert_eq!(first["option"], json!(option), "{text}");
    assert!(
        text.starts_with("fault: ") && text.contains("  fix: "),
        "{text}"
    );
    if let Some(option) = option {
        assert_contains(&text, &[&format!("option: {option}")]);
    }
}

/// Writes another initial pose.
fn posed(change: impl Fn(Isometry3<f64>) -> Isometry3<f64>) -> Scene {
    let scene = Scene::new();
    let pose = change(off(&truth(), 5));
    scene.write("init.json", pose_json(&pose).to_string());
    scene
}

#[test]
fn clean_inputs_have_no_fault() {
    let words = "doctor --model mesh.ply --model-unit m --depth depth.png --camera camera.json \
                 --init init.json --bbox 60,30,200,180";
    let folder = Scene::new().folder;
    folder.command(words).refuses(&["--mask"]);
    let (text, json) = examine(&Scene::new());
    assert_eq!(
        (&json["faults"], &json["warnings"]),
        (&json!([]), &json!([]))
    );
    assert!(text.starts_with("no fault found (score 0."), "{text}");
    // A symmetry in another unit is a warning, and the doctor still compares scores.
    let scene = Scene::new().with("--symmetries", "symmetries.json");
    let axis = json!({"axis": [0, 0, 1], "offset": [5000, 0, 0]});
    let info = json!({"1": {"diameter": 100, "symmetries_continuous": [axis]}});
    scene.write("symmetries.json", info.to_string());
    let (text, json) = examine(&scene);
    assert!(text.starts_with("no fault found (score 0."), "{text}");
    let warnings = json["warnings"].to_string();
    assert_contains(&warnings, &["symmetries.json: a declared symmetry moves"]);
}

#[test]
fn wrong_units_and_scales_are_named_with_the_option_that_corrects_them() {
    let mesh = |unit: &str| Scene::new().with("--model-unit", unit);
    for (scene, fault, option) in [
        (mesh("mm"), "mesh_scale", "--model-unit m"),
        (mesh("cm"), "mesh_scale", "--model-unit m"),
        (
            Scene::new().with("--depth-scale", "1"),
            "depth_scale",
            "--depth-scale 0.1",
        ),
        (
            Scene::new().with("--depth-scale", "0.001"),
            "depth_scale",
            "--depth-scale 0.1",
        ),
        // All depths are beyond 1 km and count as missing.
        (
            Scene::new().with("--depth-scale", "1000"),
            "depth_scale",
            "--depth-scale 0.1",
        ),
    ] {
        names(&scene, fault, Some(option));
    }
    let scene = Scene::new();
    let (rotation, millimeters) = pose_to_bop(&off(&truth(), 5));
    let meters = millimeters.map(|t| t / 1000.0);
    let pose = json!({"cam_R_m2c": rotation, "cam_t_m2c": meters});
    scene.write("init.json", pose.to_string());
    names(&scene, "translation_scale", Some("--init-unit m"));
    // The option of the diagnosis corrects the refinement.
    let refined = scene.with("--init-unit", "m").result();
    assert!(refined["confidence"].as_f64().unwrap() > 0.9);
}

#[test]
fn a_wrong_size_is_named_with_its_factor() {
    let scene = Scene::new();
    for factor in [0.87_f32, 1.15] {
        let mesh = car();
        let vertices = mesh.vertices().iter().map(|p| p * factor).collect();
        let scaled = TriMesh::new(vertices, mesh.triangles().to_vec()).unwrap();
        hicp_io::write_ply(scene.path("mesh.ply"), &scaled, LengthUnit::Meters).unwrap();
        let (_, json) = examine(&scene);
        let mut faults = json["faults"].as_array().unwrap().iter();
        let size = faults.find(|fault| fault["fault"] == "mesh_scale");
        let found = size.unwrap()["factor"].as_f64().unwrap();
        assert!((found * f64::from(factor)).ln().abs() < 0.06, "{json}");
    }
}

#[test]
fn wrong_poses_are_named() {
    let turn = Isometry3::rotation(std::f64::consts::PI * hybrid_icp::core::Vector3::x());
    names(&posed(|pose| pose.inverse()), "pose_inverted", None);
    names(&posed(|pose| turn * pose), "opengl_pose", None);
    let transposed =
        |pose: Isometry3<f64>| Isometry3::from_parts(pose.translation, pose.rotation.inverse());
    names(&posed(transposed), "rotation_transposed", None);
    let reordered = |pose: Isometry3<f64>| {
        let [x, y, z, w] = pose.rotation.coords.into();
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(z, w, x, y));
        Isometry3::from_parts(pose.translation, rotation)
    };
    names(&posed(reordered), "quaternion_order", None);
    let shift = Translation3::new(0.0, 0.1, 0.2);
    let scene = posed(|pose| pose * shift);
    names(&scene, "origin", None);
    let found = &examine(&scene).1["faults"][0]["shift_meters"];
    let error = (0..3).map(|axis| (found[axis].as_f64().unwrap() + shift.vector[axis]).abs());
    assert!(error.fold(0.0, f64::max) < 0.01, "{found}");
}

#[test]
fn wrong_masks_and_images_are_named() {
    let mask = hicp_io::read_mask_png(Scene::new().path("mask.png")).unwrap();
    let masked = |value: &dyn Fn(usize, bool) -> u8| {
        let scene = Scene::new();
        let pixels = mask.pixels().iter().enumerate();
        let pixels: Vec<u8> = pixels.flat_map(|(i, set)| [value(i, *set); 3]).collect();
        hicp_io::write_rgb_png(scene.path("mask.png"), mask.width(), mask.height(), &pixels)
            .unwrap();
        scene
    };
    names(&masked(&|_, set| u8::from(!set)), "mask_inverted", None);
    names(&masked(&|_, _| 0), "mask_empty", None);
    names(&masked(&|_, _| 1), "mask_too_large", None);
    let label = |i: usize, set: bool| if set { 3 } else { (i / 4000 % 3) as u8 };
    names(&masked(&label), "mask_labels", Some("--mask-value 3"));
    let soft = |i: usize, set: bool| {
        if set {
            250 - (i % 50) as u8
        } else {
            (i % 40) as u8
        }
    };
    names(&masked(&soft), "mask_soft", Some("--mask-threshold 125"));

    let depth = hicp_io::read_depth_png(Scene::new().path("depth.png"), 0.1).unwrap();
    let measured = |meters: &dyn Fn(f32) -> f32| {
        let scene = Scene::new();
        let (width, height) = (depth.width(), depth.height());
        let values = depth.pixels().iter().map(|z| meters(*z)).collect();
        let image = DepthImage::from_meters(width, height, values).unwrap();
        hicp_io::write_depth_png(scene.path("depth.png"), &image, 0.1).unwrap();
        scene
    };
    names(&measured(&|z| 6.5 - z), "depth_inverted", None);
    names(
        &measured(&|z| if z > 0.0 { 0.01 / z } else { 0.0 }),
        "disparity",
        None,
    );

    let scene = Scene::new();
    let camera: Value = serde_json::from_str(FLAT_CAMERA).unwrap();
    for factor in [0.75, 1.5, 2.0] {
        let [fx, fy, cx, cy] =
            ["fx", "fy", "cx", "cy"].map(|key| factor * camera[key].as_f64().unwrap());
        let camera = json!({"fx": fx, "fy": fy, "cx": cx, "cy": cy});
        scene.write("camera.json", camera.to_string());
        names(&scene, "intrinsics", None);
    }
    // Those of another camera with images of this size.
    for factor in [1.2, 1.4] {
        scene.write("camera.json", FLAT_CAMERA);
        scene.change_json("camera.json", |camera| {
            (camera["fx"], camera["fy"]) = (json!(400.0 * factor), json!(402.0 * factor));
        });
        names(&scene, "focal_length", None);
    }

    let scene = Scene::new()
        .with("--depth-camera", "camera.json")
        .with("--camera-from-depth", "near.txt");
    scene.write("near.txt", "1 0 0 -0.06\n0 1 0 0\n0 0 1 0\n");
    names(&scene, "misaligned", None);
    assert_contains(&examine(&scene).0, &["left of the mask", "check near.txt"]);

    let scene = Scene::new();
    let mesh = car();
    let turned = mesh
        .triangles()
        .iter()
        .map(|[a, b, c]| [*a, *c, *b])
        .collect();
    let mesh = TriMesh::new(mesh.vertices().to_vec(), turned).unwrap();
    hicp_io::write_ply(scene.path("mesh.ply"), &mesh, LengthUnit::Meters).unwrap();
    names(&scene, "mesh_inside_out", None);
}

#[test]
fn an_output_file_has_the_json() {
    let scene = Scene::new().with("--model-unit", "mm");
    let (_, json) = examine(&scene);
    let told = scene.run_command("doctor").exits(0);
    assert!(
        told.out
            .starts_with("fault: the mesh is 1000 times too small"),
        "{}",
        told.out
    );
    // The warnings of `refine` are there, too.
    let first = json["warnings"][0].as_str().unwrap();
    assert!(
        first.contains("check --model-unit mm") && !first.contains("doctor"),
        "{first}"
    );
    assert_contains(&told.err, &[&format!("warning: {first}\n")]);
    assert_eq!(scene.json("out.json"), json);
}
