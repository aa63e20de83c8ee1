//! `hybrid-icp refine` on valid inputs.

use crate::common::*;
use hicp_io::LengthUnit;
use hybrid_icp::core::{DepthImage, Isometry3, Mask, Point3, TriMesh, Vector3};
use hybrid_icp::raster::render_depth_image;
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
fn the_result_has_every_key_in_its_type() {
    let scene = Scene::new().with("--overlay", "overlay.png");
    let result = scene.result();
    assert_improved(&pose_of(&result), &truth());
    for (key, count) in [("cam_R_m2c", 9), ("cam_t_m2c", 3)] {
        let numbers = result[key].as_array().unwrap();
        assert!(numbers.len() == count && numbers.iter().all(Value::is_f64));
    }
    for key in ["mve_initial", "time_ms"] {
        assert!(result[key].as_f64().unwrap() > 0.0, "{key}");
    }
    assert!(result["mve"].as_f64().unwrap() >= 0.0);
    assert!(result["mve"].as_f64() < result["mve_initial"].as_f64());
    let confidence = result["confidence"].as_f64().unwrap();
    assert!((0.95..=1.0).contains(&confidence), "{result}");
    assert!(result["expected_error_mm"].as_f64().unwrap() < 20.0);
    assert!(result["expected_error_degrees"].as_f64().unwrap() < 20.0);
    // The result is near the initial pose, so other poses do not count.
    assert_eq!(result["look_alikes"], 0.0);
    let evidence = &result["evidence"];
    assert!(evidence["agrees"].as_f64().unwrap() > 0.9, "{evidence}");
    assert!(
        evidence["seen_through"].as_f64().unwrap() < 0.1,
        "{evidence}"
    );
    for key in ["iterations", "n_pairs"] {
        assert!(result[key].as_u64().unwrap() > 0, "{key}");
    }
    for key in ["termination", "reason", "pipeline"] {
        assert!(!result[key].as_str().unwrap().is_empty(), "{key}");
    }
    assert_eq!(result["outcome"], "refined");
    assert_eq!(result["warnings"], serde_json::json!([]));

    let stages = result["trace"].as_array().unwrap();
    assert!(!stages.is_empty());
    for (index, stage) in stages.iter().enumerate() {
        assert_eq!(stage["stage"].as_u64(), Some(index as u64 + 1));
        for key in [
            "association",
            "metric",
            "selection",
            "termination",
            "outcome",
        ] {
            assert!(stage[key].is_string(), "{key}");
        }
        for key in ["filters", "stop_rules"] {
            assert!(stage[key].is_array(), "{key}");
        }
        for key in ["iterations", "n_pairs", "n_source"] {
            assert!(stage[key].is_u64(), "{key}");
        }
        assert!(stage["mean_loss"].as_f64().unwrap() >= 0.0);
    }
    let sum: u64 = stages
        .iter()
        .map(|s| s["iterations"].as_u64().unwrap())
        .sum();
    assert_eq!(result["iterations"].as_u64(), Some(sum));

    let overlay = hicp_io::read_color(scene.path("overlay.png")).unwrap();
    let (width, height) = (overlay.width(), overlay.height());
    // Twice as large, without rows far above and below the object, and with a legend.
    assert!(width == 640 && (370..530).contains(&height), "{height}");
    for color in [[230, 159, 0], [86, 180, 233]] {
        assert!(overlay.pixels().contains(&color));
    }
}

#[test]
fn without_an_output_the_json_is_printed_alone() {
    let scene = Scene::new();
    let mut written = scene.result();
    let printed = scene.without("--output").run().exits(0);
    let mut printed: Value = serde_json::from_str(&printed.out).unwrap();
    for result in [&mut written, &mut printed] {
        result["time_ms"] = Value::Null;
    }
    assert_eq!(written, printed);
}

#[test]
fn every_line_of_a_trace_can_be_the_start_of_another_run() {
    // `hybrid` returns the pose of its last stage; `auto` returns the best of its stages.
    let scene = Scene::new()
        .with("--trace", "trace.jsonl")
        .with("--pipeline", "hybrid");
    let result = scene.result();
    let text = std::fs::read_to_string(scene.path("trace.jsonl")).unwrap();
    let lines: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let of = |event: &str| {
        lines
            .iter()
            .filter(|l| l["event"] == event)
            .collect::<Vec<_>>()
    };
    let stages = result["trace"].as_array().unwrap();
    assert_eq!(of("stage_end").len(), stages.len());
    assert_eq!(of("regime").len(), 2);
    // An iteration without pairs evaluates nothing and has no line.
    assert!(of("iteration").len() <= result["iterations"].as_u64().unwrap() as usize);
    let last = of("stage_end")[stages.len() - 1];
    assert_eq!(last["cam_R_m2c"], result["cam_R_m2c"]);
    assert_eq!(last["cam_t_m2c"], result["cam_t_m2c"]);
    // A run from the pose of the last line starts with the MVE of this result.
    scene.write("init.json", last.to_string());
    let again = scene.result();
    assert_eq!(again["mve_initial"], result["mve"]);
}

/// The result has the same warnings as standard error, word for word.
#[test]
fn the_result_has_every_warning() {
    let told = |scene: &Scene, parts: &[&str]| {
        let run = scene.run().exits(0).complains(parts);
        let text = std::fs::read_to_string(scene.path("out.json")).unwrap();
        let result: Value = serde_json::from_str(&text).unwrap();
        let warnings = result["warnings"].as_array().unwrap().iter();
        let lines = warnings.map(|text| format!("warning: {}\n", text.as_str().unwrap()));
        assert_eq!(lines.collect::<String>(), run.err);
        result
    };
    let scene = Scene::new().with("--depth-scale", "1");
    told(
        &scene,
        &["the median depth inside the mask", "do not trust it"],
    );

    // The search finds the car in its mask from any initial pose, and its confidence is high.
    let scene = Scene::new();
    let aside = Isometry3::translation(3.0, 0.0, 0.0) * truth();
    scene.write("init.json", pose_json(&aside).to_string());
    let result = told(&scene, &[]);
    let confidence = result["confidence"].as_f64().unwrap();
    assert!(
        confidence >= 0.95 && result["mve_initial"] == 1.0,
        "{result}"
    );
}

#[test]
fn a_trace_is_replayed_to_the_last_digit() {
    let scene = Scene::new()
        .with("--trace", "trace.jsonl")
        .with("--set", "stage.stages.1.misaligned.stages.1.max_steps=2");
    scene.result();
    let replay = || run(&scene.path(""), ["replay", "trace.jsonl"]);
    let printed = replay().exits(0).out;
    let text = std::fs::read_to_string(scene.path("trace.jsonl")).unwrap();
    assert!(printed.contains(&format!("{} lines, all equal", text.lines().count())));
    // A changed line is reported.
    let (number, line) = text
        .lines()
        .enumerate()
        .find(|(_, line)| line.contains("mean_loss"))
        .unwrap();
    let mut changed: Value = serde_json::from_str(line).unwrap();
    changed["n_pairs"] = 1.into();
    scene.write("trace.jsonl", text.replace(line, &changed.to_string()));
    let complaint = format!("trace.jsonl:{} differs", number + 1);
    replay().exits(1).complains(&[&complaint]);
    // Other files are refused.
    for (content, expected) in [
        ("", "empty, expected a trace"),
        ("{", "trace.jsonl:1: expected JSON"),
        ("{\"event\": \"iteration\"}", "expected \"start\""),
        (
            "{\"event\": \"start\", \"version\": 3}",
            "\"version\" is 3, expected a string",
        ),
        (
            "{\"event\": \"start\", \"version\": \"0.1.0\", \"set\": \"times=1\"}",
            "\"set\" is \"times=1\", expected a list of strings",
        ),
    ] {
        scene.write("trace.jsonl", content);
        replay().exits(1).complains(&[expected]);
    }
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
    assert!(text.contains(reason), "{text}");
    let init = std::fs::read_to_string(scene.path("init.json")).unwrap();
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
fn objects_out_of_view_and_odd_meshes_have_an_outcome() {
    let honest = |scene: &Scene| {
        let result = scene.result();
        let outcome = result["outcome"].as_str().unwrap();
        assert!(["refined", "kept_initial"].contains(&outcome));
        assert!(result["mve"].is_f64() && result["mve_initial"].is_f64());
        let _ = pose_of(&result);
        // A pose that is worse than the initial one, or bad, gives a warning.
        let (mve, init) = (result["mve"].as_f64(), result["mve_initial"].as_f64());
        let err = scene.run().err;
        assert_eq!(err.contains("worse than the initial"), mve > init);
        assert_eq!(err.contains("do not trust it"), mve >= Some(0.4));
        result
    };
    for (x, z) in [
        (0.0, -0.5),
        (0.0, 0.0),
        (5.0, 0.5),
        (0.0, 1e-9),
        (1e12, 1e12),
    ] {
        let scene = Scene::new().with("--overlay", "overlay.png");
        let pose = Isometry3::translation(x, 0.0, z);
        scene.write("init.json", pose_json(&pose).to_string());
        honest(&scene);
    }

    // Half of the object is outside the image.
    let scene = Scene::new().with("--overlay", "overlay.png");
    let mut pose = truth();
    pose.translation.vector += Vector3::new(-0.22, 0.0, 0.0);
    let depth = render_depth_image(&car(), &camera(), &pose);
    let pixels = depth.pixels().iter().filter(|z| **z > 0.0).count();
    let at_the_edge = (0..240).filter(|v| depth.get(0, *v).unwrap() > 0.0).count();
    assert!(pixels > 500 && at_the_edge > 20, "{pixels} {at_the_edge}");
    hicp_io::write_depth_png(scene.path("depth.png"), &depth, 0.1).unwrap();
    hicp_io::write_mask_png(scene.path("mask.png"), &mask_of(&depth)).unwrap();
    scene.write("init.json", pose_json(&off(&pose, 2)).to_string());
    let result = honest(&scene);
    assert!(result["n_pairs"].as_u64().unwrap() > 100, "{result}");

    let scene = Scene::new();
    let corners = vec![
        Point3::origin(),
        Point3::new(0.1, 0.0, 0.0),
        Point3::new(0.0, 0.1, 0.0),
    ];
    let triangle = TriMesh::new(corners, vec![[0, 1, 2]]).unwrap();
    hicp_io::write_ply(scene.path("mesh.ply"), &triangle, LengthUnit::Meters).unwrap();
    honest(&scene);
}

#[test]
fn three_hundred_thousand_triangles_are_refined() {
    let scene = Scene::new();
    // The mesh is a bent sheet without symmetry.
    let side = 388_u32;
    let at = |i: u32, j: u32| {
        let (x, y) = (f64::from(i) / 388.0 - 0.5, f64::from(j) / 388.0 - 0.5);
        let z = 0.03 * (7.0 * x).sin() * (5.0 * y + 1.0).cos() + 0.02 * x * y;
        Point3::new(0.2 * x, 0.15 * y, z).cast::<f32>()
    };
    let vertices = (0..=side)
        .flat_map(|j| (0..=side).map(move |i| at(i, j)))
        .collect();
    let cell = |i: u32, j: u32| {
        let a = j * (side + 1) + i;
        let b = a + side + 1;
        [[a, a + 1, b + 1], [a, b + 1, b]]
    };
    let triangles: Vec<_> = (0..side)
        .flat_map(|j| (0..side).flat_map(move |i| cell(i, j)))
        .collect();
    assert!(triangles.len() > 300_000);
    let mesh = TriMesh::new(vertices, triangles).unwrap();
    let pose = Isometry3::new(Vector3::new(0.0, 0.0, 0.4), Vector3::new(2.6, 0.3, 0.2));
    let depth = render_depth_image(&mesh, &camera(), &pose);
    hicp_io::write_ply(scene.path("mesh.ply"), &mesh, LengthUnit::Meters).unwrap();
    hicp_io::write_depth_png(scene.path("depth.png"), &depth, 0.1).unwrap();
    hicp_io::write_mask_png(scene.path("mask.png"), &mask_of(&depth)).unwrap();
    scene.write("init.json", pose_json(&off(&pose, 3)).to_string());
    assert_improved(&pose_of(&scene.result()), &pose);
}

#[test]
fn units_that_do_not_match_are_warned_of() {
    let warned = |scene: &Scene, parts: &[&str]| {
        scene.run().exits(0).complains(parts);
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
    warned(&scene, &["warning: depth.png", "1.000e300 m", "cam_t_m2c"]);
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

#[test]
fn a_pose_can_be_refined_in_place() {
    let scene = Scene::new().with("--output", "./init.json");
    scene.run().exits(0);
    let text = std::fs::read_to_string(scene.path("init.json")).unwrap();
    assert_improved(&pose_of(&serde_json::from_str(&text).unwrap()), &truth());
    // The result can be refined again.
    scene.run().exits(0);
}

#[cfg(unix)]
#[test]
fn names_that_are_not_utf_8_are_accepted() {
    use std::os::unix::ffi::OsStrExt;
    let name = |bytes: &[u8]| std::ffi::OsStr::from_bytes(bytes).to_owned();
    let scene = Scene::new();
    let odd = scene.folder.path().join(name(b"m\xff.ply"));
    std::fs::rename(scene.path("mesh.ply"), odd).unwrap();
    let scene = scene
        .with("--model", name(b"m\xff.ply"))
        .with("--output", name(b"o\xfe.json"))
        .with("--overlay", name(b"\xfd.png"));
    scene.run().exits(0);
    assert!(scene.folder.path().join(name(b"o\xfe.json")).is_file());
    // Only a trace stores the names of its inputs as text; its own name may be any.
    let scene = scene.with("--trace", "trace.jsonl");
    let told = scene.run().exits(1);
    assert_eq!(told.out, "");
    told.complains(&["--model names m\u{fffd}.ply", "not UTF-8", "--trace"]);
    assert!(!scene.path("trace.jsonl").exists());
    let odd = scene.folder.path().join(name(b"m\xff.ply"));
    std::fs::copy(odd, scene.path("mesh.ply")).unwrap();
    let scene = scene
        .with("--model", "mesh.ply")
        .with("--trace", name(b"t\xfc.jsonl"));
    scene.run().exits(0);
    let scene = scene.without("--trace");
    scene
        .with("--init", name(b"no\xff.json"))
        .run()
        .exits(1)
        .complains(&["cannot read no"]);
}

#[test]
fn other_poses_that_a_search_finds_are_written() {
    let scene = Scene::new()
        .with("--alternatives", "others.json")
        .with("--pipeline", "always.toml");
    let always = hybrid_icp::Preset::Search.toml();
    let limit = "good_enough = 0.02\n";
    let always = always.replace(limit, "good_enough = 0.0\nstart = \"ignored\"\n");
    std::fs::write(scene.path("always.toml"), always).unwrap();
    scene.run().exits(0);
    let text = std::fs::read_to_string(scene.path("others.json")).unwrap();
    let others: Vec<Value> = serde_json::from_str(&text).unwrap();
    assert!(!others.is_empty());
    let mut last = 0.0;
    for other in &others {
        let number = |key: &str| other[key].as_f64().unwrap();
        assert!(number("score") >= last && number("mssd_mm") > 1.0);
        assert!(number("gap") <= number("score") && number("rotation_degrees") > 0.0);
        assert!(pose_of(other).translation.z > 0.0);
        last = number("score");
    }
}
