//! Inputs that `hybrid-icp refine` refuses, with messages that name file, field, value and
//! expectation.

use crate::common::*;
use hybrid_icp::core::{DepthImage, Mask};

/// Asserts that a scene is refused with all of these texts and that existing outputs are kept.
#[track_caller]
fn refused(scene: Scene, parts: &[&str]) {
    let scene = if scene.arguments.iter().any(|(o, _)| *o == "--overlay") {
        scene
    } else {
        scene.with("--overlay", "overlay.png")
    };
    for name in ["out.json", "overlay.png"] {
        scene.write(name, "the user's");
    }
    let before = scene.names("");
    let told = scene.run().fails(parts);
    assert!(told.err.starts_with("error: "), "{}", told.err);
    assert_eq!(told.err.lines().count(), 1, "{}", told.err);
    assert_eq!(told.out, "");
    for name in ["out.json", "overlay.png"] {
        assert_eq!(scene.bytes(name), b"the user's");
    }
    assert_eq!(scene.names(""), before, "nothing is left behind");
}

#[track_caller]
fn refused_file(name: &str, content: impl AsRef<[u8]>, parts: &[&str]) {
    let scene = Scene::new();
    scene.write(name, content);
    refused(scene, parts);
}

#[test]
fn missing_files() {
    for option in ["--model", "--depth", "--mask", "--camera", "--init"] {
        let scene = Scene::new().with(option, "gone.ply");
        refused(scene, &["cannot read gone.ply", "No such file"]);
    }
}

#[test]
fn cameras() {
    let negative = FLAT_CAMERA.replace("402", "-402");
    refused_file(
        "camera.json",
        negative,
        &["camera.json", "fy is -402", "0.001 to"],
    );
    let zero = BOP_CAMERA.replace("[400", "[0");
    refused_file(
        "camera.json",
        zero,
        &["camera.json", "cam_K", "fx is 0", "0.001 to"],
    );
    refused(
        Scene::new().without("--depth-scale"),
        &[
            "camera.json",
            "depth_scale",
            "--depth-scale",
            "millimeters per unit",
        ],
    );
}

#[test]
fn sizes_that_disagree_name_both_files_and_sizes() {
    let small = FLAT_CAMERA.replace("320", "640").replace("240", "480");
    refused_file(
        "camera.json",
        small,
        &["camera.json", "640x480", "depth.png", "320x240"],
    );

    let scene = Scene::new();
    hicp_io::write_mask_png(scene.path("mask.png"), &Mask::full(160, 120)).unwrap();
    refused(scene, &["mask.png", "160x120", "depth.png", "320x240"]);

    let scene = Scene::new();
    let depth = DepthImage::from_meters(64, 48, vec![1.0; 64 * 48]).unwrap();
    hicp_io::write_depth_png(scene.path("depth.png"), &depth, 1.0).unwrap();
    refused(scene, &["mask.png", "320x240", "depth.png", "64x48"]);
}

#[test]
fn images() {
    let scene = Scene::new();
    let whole = scene.bytes("depth.png");
    scene.write("depth.png", &whole[..whole.len() / 2]);
    refused(scene, &["depth.png", "PNG"]);
    let scene = Scene::new();
    hicp_io::write_mask_png(scene.path("depth.png"), &Mask::full(320, 240)).unwrap();
    refused(scene, &["depth.png", "8-bit gray", "16-bit gray"]);
    refused_file("mask.png", "XY 320 240", &["mask.png", "PNG"]);
}

#[test]
fn initial_poses() {
    let pose = |rotation: &str| format!(r#"{{"cam_R_m2c": {rotation}, "cam_t_m2c": [0,0,500]}}"#);
    for (rotation, parts) in [
        (
            "[1,0,0,0,1,0,0,0,-1]",
            ["determinant -1", "expected 1", "0.002"],
        ),
        ("[1,0,0,0,1,0,0,0]", ["array of 8", "expected", "9 numbers"]),
    ] {
        let parts = [&["init.json", "cam_R_m2c"], &parts[..]].concat();
        refused_file("init.json", pose(rotation), &parts);
    }
    // A rotation that is rounded to three digits is accepted.
    let scene = Scene::new();
    scene.write("init.json", pose("[1,0,0,0,0.760,-0.649,0,0.649,0.760]"));
    scene.run().exits(0);
}

#[test]
fn meshes() {
    refused(
        Scene::new().with("--model", "init.json"),
        &["init.json", "\"json\""],
    );
    refused_file("mesh.ply", "", &["mesh.ply"]);
    let scene = Scene::new().with("--model", "a.obj");
    scene.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
    refused(scene, &["a.obj, line 4", "\"f 1 2 4\"", "expected"]);
}

#[test]
fn outputs_are_checked_before_anything_is_read() {
    for option in ["--output", "--overlay"] {
        // The model is missing too, but the message is about the output.
        let scene = Scene::new()
            .with("--model", "gone.ply")
            .with(option, "no/where");
        refused(
            scene,
            &["cannot write no/where", "folder no does not exist"],
        );
        refused(
            Scene::new().with(option, "."),
            &["cannot write .", "directory"],
        );
        for input in ["mesh.ply", "depth.png", "mask.png", "camera.json"] {
            let scene = Scene::new().with(option, format!("./{input}"));
            let content = scene.bytes(input);
            let path = scene.path(input);
            let told = scene.run().fails(&[option, input, "overwritten"]);
            assert_eq!(told.out, "");
            assert_eq!(std::fs::read(path).unwrap(), content);
        }
    }
    let scene = Scene::new().with("--overlay", "init.json");
    scene.run().fails(&["--overlay", "--init", "init.json"]);
    let scene = Scene::new().with("--output", "-").with("--overlay", "-");
    let told = scene
        .run()
        .fails(&["--output", "--overlay", "standard output"]);
    assert_eq!(told.out, "");
    // Without --output, the report goes there.
    let scene = Scene::new().without("--output").with("--alternatives", "-");
    let told = scene.run().fails(&["--alternatives", "standard output"]);
    assert_eq!(told.out, "");
    let scene = Scene::new().with("--output", "x").with("--overlay", "./x");
    scene
        .run()
        .fails(&["--output", "--overlay", "different files"]);
    assert!(!scene.path("x").exists());
    // The path of the folder is a file.
    refused(
        Scene::new().with("--output", "mask.png/out.json"),
        &["cannot write mask.png/out.json"],
    );
}

#[test]
fn a_result_replaces_an_older_one_and_leaves_no_other_file() {
    let scene = Scene::new();
    scene.write("out.json", "older");
    let before = scene.names("");
    scene.result();
    assert_eq!(scene.names(""), before);
}
