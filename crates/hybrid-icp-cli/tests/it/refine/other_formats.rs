//! Masks of many values, other forms of poses, and names of files, in `hybrid-icp refine`.

use std::ffi::OsStr;
use std::process::Command;

use crate::common::*;

/// A scene whose mask is a label image: 3 on the car, and 1 or 0 elsewhere.
fn labeled() -> Scene {
    let scene = Scene::new().with("--mask", "labels.png");
    let mask = hicp_io::read_mask_png(scene.path("mask.png")).unwrap();
    let labels = mask.pixels().iter().zip(0..);
    let labels: Vec<u8> = labels
        .flat_map(|(set, i)| [if *set { 3 } else { u8::from(i % 2 == 0) }; 3])
        .collect();
    hicp_io::write_rgb_png(scene.path("labels.png"), 320, 240, &labels).unwrap();
    scene
}

#[test]
fn a_label_image_is_named_and_a_value_selects_the_object() {
    let plain = Scene::new().result();
    let warned = labeled().run().exits(0);
    assert_contains(
        &warned.err,
        &["warning: labels.png: the values 0, 1 and 3", "--mask-value"],
    );
    for (option, value) in [("--mask-value", "3"), ("--mask-threshold", "2")] {
        let scene = labeled().with(option, value);
        let selected = scene.result();
        assert_eq!(selected["cam_t_m2c"], plain["cam_t_m2c"], "{option}");
        assert_eq!(selected["warnings"], plain["warnings"], "{option}");
    }
    let parts = ["labels.png: found no pixel", "0, 1 and 3"];
    labeled().with("--mask-value", "7").run().fails(&parts);
}

#[test]
fn a_trace_repeats_the_options_of_other_formats() {
    let init = off(&truth(), 5);
    let scene = labeled()
        .with("--mask-value", "3")
        .with("--init", "pose.txt")
        .with("--init-unit", "mm")
        .with("--depth-camera", "camera.json")
        .with("--camera-from-depth", "near.txt")
        .with("--camera-from-depth-unit", "mm")
        .with("--trace", "trace.jsonl");
    let (t, q) = (init.translation.vector * 1000.0, init.rotation.coords);
    scene.write(
        "pose.txt",
        format!("{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w),
    );
    // In meters, the object would be 3 m farther away.
    scene.write("near.txt", "1 0 0 0\n0 1 0 0\n0 0 1 3\n0 0 0 1\n");
    let far = (truth().translation.vector - pose_of(&scene.result()).translation.vector).norm();
    assert!(far < 0.005, "{far}");
    scene.command("replay trace.jsonl").exits(0);
}

#[test]
fn the_second_camera_needs_its_pose() {
    let alone = Scene::new().with("--depth-camera", "camera.json");
    alone.run().refuses(&["--camera-from-depth"]);
}

#[test]
fn a_mesh_needs_a_unit_unless_the_format_states_it() {
    let scene = Scene::new().without("--model-unit");
    scene.run().refuses(&["--model-unit", "m, mm or cm"]);
    // A caller in the same process gets the code and goes on.
    let given = scene.arguments.iter();
    let words = given.flat_map(|(option, value)| [OsStr::new(*option), value]);
    let program = ["hybrid-icp", "refine"].map(OsStr::new).into_iter();
    assert_eq!(hybrid_icp_cli::run(program.chain(words)), 2);
}

#[test]
fn pictures_have_the_name_of_a_png_file() {
    let scene = Scene::new().with("--overlay", "a.jpg");
    scene.run().fails(&["--overlay names a.jpg", ".png"]);
    assert!(!scene.path("a.jpg").exists());
}

#[test]
fn control_characters_of_names_do_not_reach_the_terminal() {
    let scene = Scene::new().with("--model", "a\u{1b}[31m\nb.ply");
    let told = scene.run().exits(1).err;
    assert!(
        !told.contains('\u{1b}') && told.contains("a\\u{1b}[31m\\nb.ply"),
        "{told}"
    );
    assert_eq!(told.lines().count(), 1, "{told}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_result_that_nobody_can_read_is_an_error() {
    let scene = Scene::new().without("--output");
    let words = scene.arguments.iter();
    let words = words.map(|(option, value)| format!("{option} {}", value.display()));
    let words = words.collect::<Vec<_>>().join(" ");
    for (redirected, code) in [(">&-", 1), ("> /dev/null", 0)] {
        let line = format!(
            "{} refine {words} {redirected}",
            env!("CARGO_BIN_EXE_hybrid-icp")
        );
        let mut shell = Command::new("sh");
        let output = shell
            .args(["-c", &line])
            .current_dir(scene.root())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(code), "{redirected}");
    }
}
