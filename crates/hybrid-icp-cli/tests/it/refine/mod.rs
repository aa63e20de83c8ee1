//! `hybrid-icp refine` on valid inputs; below, its errors and results, `estimate` and `doctor`.

mod color;
mod doctor;
mod estimate;
mod other_formats;
mod refusals;
mod results;

use crate::common::*;
use hicp_io::LengthUnit;
use hybrid_icp::core::{DepthImage, Isometry3, Mask, TriMesh};
use serde_json::Value;

/// Writes a mesh as binary STL.
fn stl(mesh: &TriMesh, units_per_meter: f32) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(u32::try_from(mesh.triangles().len()).unwrap().to_le_bytes());
    for triangle in 0..mesh.triangles().len() {
        bytes.extend([0; 12]);
        for corner in mesh.corners(triangle) {
            for coordinate in corner.iter() {
                bytes.extend((coordinate * units_per_meter).to_le_bytes());
            }
        }
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn forms_of_cameras_and_units_of_meshes_agree() {
    let reference = Scene::new().result();
    let near = |scene: &Scene, what: &str| {
        let result = scene.result();
        for key in ["cam_R_m2c", "cam_t_m2c"] {
            for index in 0..reference[key].as_array().unwrap().len() {
                let (a, b) = (&result[key][index], &reference[key][index]);
                let difference = a.as_f64().unwrap() - b.as_f64().unwrap();
                assert!(difference.abs() < 0.02, "{what}: {key}[{index}] {a} {b}");
            }
        }
    };

    let scene = Scene::new().without("--depth-scale");
    for text in [
        BOP_CAMERA.to_owned(),
        format!(r#"{{"12": {BOP_CAMERA}}}"#),
        FLAT_CAMERA.replace('}', r#", "depth_scale": 0.1}"#),
    ] {
        scene.write("camera.json", &text);
        near(&scene, &text);
    }
    // The option has priority over the file.
    scene.write("camera.json", BOP_CAMERA.replace("0.1", "7"));
    near(&scene.with("--depth-scale", "0.1"), "--depth-scale");

    let mesh = car();
    for unit in [
        LengthUnit::Meters,
        LengthUnit::Millimeters,
        LengthUnit::Centimeters,
    ] {
        let scene = Scene::new().with("--model-unit", unit.to_string());
        hicp_io::write_ply(scene.path("mesh.ply"), &mesh, unit).unwrap();
        near(&scene, &format!("PLY in {unit}"));
        let scene = scene.with("--model", "mesh.obj");
        hicp_io::write_obj(scene.path("mesh.obj"), &mesh, unit).unwrap();
        near(&scene, &format!("OBJ in {unit}"));
        let scene = scene.with("--model", "mesh.STL");
        scene.write(
            "mesh.STL",
            stl(&mesh, (1.0 / unit.meters_per_unit()) as f32),
        );
        near(&scene, &format!("STL in {unit}"));
    }
}

#[test]
fn every_pipeline_is_reachable_by_name() {
    for preset in hybrid_icp::Preset::ALL {
        let result = Scene::new().with("--pipeline", preset.name()).result();
        assert_eq!(result["pipeline"], preset.name());
        assert!(result["mve"].as_f64().unwrap() < 0.6);
    }
}

/// A pose file with a rounded rotation, which is orthogonal to fewer digits than an `f64` has.
const ROUNDED: &str = r#"{"cam_R_m2c": [0.768311175, -0.0665434694, 0.636608126, 0.311033385, 0.908074697, -0.280461366,
    -0.559424858, 0.413487982, 0.718381178], "cam_t_m2c": [0.1, -2e-7, 500]}"#;

#[track_caller]
fn assert_kept(scene: &Scene, reason: &str) {
    let result = scene.result();
    assert_eq!(result["outcome"], "kept_initial", "{result}");
    let text = result["reason"].as_str().unwrap();
    assert_contains(text, &[reason]);
    let init = scene.read("init.json");
    let init: Value = serde_json::from_str(&init).unwrap();
    for key in ["cam_R_m2c", "cam_t_m2c"] {
        let numbers = |value: &Value| -> Vec<u64> {
            let items = value[key].as_array().unwrap();
            items
                .iter()
                .map(|n| n.as_f64().unwrap().to_bits())
                .collect()
        };
        assert_eq!(numbers(&result), numbers(&init));
    }
    for key in ["mve", "mve_initial"] {
        let value = result[key].as_f64().unwrap();
        assert!((0.0..=1.0).contains(&value), "{key} {value}");
    }
}

#[test]
fn a_pose_that_cannot_be_refined_keeps_the_numbers_of_the_file() {
    let scene = Scene::new().with("--overlay", "overlay.png");
    scene.write("init.json", ROUNDED);
    hicp_io::write_mask_png(
        scene.path("mask.png"),
        &Mask::new(320, 240, vec![false; 320 * 240]).unwrap(),
    )
    .unwrap();
    assert_kept(&scene, "the mask is empty");
    assert!(hicp_io::read_color(scene.path("overlay.png")).is_ok());

    let scene = Scene::new();
    scene.write("init.json", ROUNDED);
    let nothing = DepthImage::from_meters(320, 240, vec![0.0; 320 * 240]).unwrap();
    hicp_io::write_depth_png(scene.path("depth.png"), &nothing, 0.1).unwrap();
    assert_kept(&scene, "no depth was measured inside the mask");
    scene.run().complains(&["warning: MVE", "do not trust it"]);

    let scene = Scene::new().with("--pipeline", "projective-point-to-plane");
    let behind = Isometry3::translation(0.0, 0.0, -0.5);
    scene.write("init.json", pose_json(&behind).to_string());
    assert_kept(&scene, "behind the camera");
    scene
        .run()
        .complains(&["init.json", "-0.5", "behind the camera"]);

    let scene = Scene::new().with("--pipeline", "projective-point-to-point");
    let aside = Isometry3::translation(0.0, 0.2, 0.5) * truth().rotation;
    scene.write("init.json", pose_json(&aside).to_string());
    assert_kept(&scene, "no pairs");
}

#[test]
fn warnings_follow_the_mve_of_an_object_out_of_view() {
    let scene = Scene::new().with("--overlay", "overlay.png");
    let aside = Isometry3::translation(5.0, 0.0, 0.5);
    scene.write("init.json", pose_json(&aside).to_string());
    let result = scene.result();
    let outcome = result["outcome"].as_str().unwrap();
    assert!(["refined", "kept_initial"].contains(&outcome));
    let _ = pose_of(&result);
    // A pose that is worse than the initial one, or bad, gives a warning.
    let [mve, init] = ["mve", "mve_initial"].map(|key| result[key].as_f64().unwrap());
    let err = scene.run().err;
    assert_eq!(err.contains("worse than the initial"), mve > init);
    assert_eq!(err.contains("do not trust it"), mve >= 0.4);
}

#[test]
fn units_that_do_not_match_are_warned_of() {
    let warned = |scene: &Scene, parts: &[&str]| {
        scene.run().warns(parts);
    };
    warned(
        &Scene::new().with("--depth-scale", "100"),
        &[
            "warning: depth.png",
            "--depth-scale",
            "100 mm per unit",
            "0.5",
        ],
    );
    warned(
        &Scene::new().with("--depth-scale", "0.0001"),
        &["warning: depth.png", "--depth-scale", "0.0001 mm per unit"],
    );
    warned(
        &Scene::new().with("--depth-scale", "1e9"),
        &[
            "warning: depth.png",
            "no depth inside the mask",
            "--depth-scale",
        ],
    );
    let scene = Scene::new();
    let far = Isometry3::translation(0.0, 0.0, 1e300);
    scene.write("init.json", pose_json(&far).to_string());
    warned(
        &scene,
        &["warning: depth.png", "1.000e300 m", "--init-unit"],
    );
    let scene = Scene::new().with("--model-unit", "mm");
    warned(
        &scene,
        &["warning: mesh.ply", "diameter", "--model-unit mm"],
    );
    hicp_io::write_ply(scene.path("mesh.ply"), &car(), LengthUnit::Millimeters).unwrap();
    warned(
        &scene.with("--model-unit", "m"),
        &["warning: mesh.ply", "diameter", "--model-unit m"],
    );
    let scene = Scene::new().with("--model-unit", "mm");
    hicp_io::write_ply(scene.path("mesh.ply"), &car(), LengthUnit::Centimeters).unwrap();
    warned(&scene, &["warning: mask.png", "pixels", "--model-unit mm"]);
    // Correct inputs give no warning.
    assert_eq!(Scene::new().run().exits(0).err, "");
}

#[cfg(unix)]
#[test]
fn names_that_are_not_utf_8_are_accepted() {
    use std::os::unix::ffi::OsStrExt;
    let name = |bytes: &[u8]| std::ffi::OsStr::from_bytes(bytes).to_owned();
    let scene = Scene::new();
    let odd = scene.root().join(name(b"m\xff.ply"));
    std::fs::rename(scene.path("mesh.ply"), odd).unwrap();
    let scene = scene
        .with("--model", name(b"m\xff.ply"))
        .with("--output", name(b"o\xfe.json"))
        .with("--overlay", name(b"\xfd.png"));
    scene.run().exits(0);
    assert!(scene.root().join(name(b"o\xfe.json")).is_file());
    // Only a trace stores the names of its inputs as text; its own name may be any.
    let scene = scene.with("--trace", "trace.jsonl");
    let told = scene.run().exits(1);
    assert_eq!(told.out, "");
    told.complains(&["--model names m\u{fffd}.ply", "not UTF-8", "--trace"]);
    assert!(!scene.path("trace.jsonl").exists());
    let odd = scene.root().join(name(b"m\xff.ply"));
    std::fs::copy(odd, scene.path("mesh.ply")).unwrap();
    let scene = scene
        .with("--model", "mesh.ply")
        .with("--trace", name(b"t\xfc.jsonl"));
    scene.run().exits(0);
    let scene = scene.without("--trace");
    scene
        .with("--init", name(b"no\xff.json"))
        .run()
        .fails(&["cannot read no"]);
}
