//! The JSON of the result, the trace, and where they are written.

use super::*;
use hicp_sim::Household;
use hybrid_icp::raster::render_depth_image;
use serde_json::json;

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
    // The image shows which side of the object is in front.
    assert!(result["look_alikes"].as_f64().unwrap() < 1e-3);
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
    let mut printed = printed.json();
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
    let lines = scene.json_lines("trace.jsonl");
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
        let run = scene.run().warns(parts);
        let result = scene.json("out.json");
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
    let replay = || scene.command("replay trace.jsonl");
    let printed = replay().exits(0).out;
    let text = scene.read("trace.jsonl");
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
    replay().fails(&[&complaint]);
    // Other files are refused.
    let in_inches = text.replace(r#""model_unit":"m""#, r#""model_unit":"inch""#);
    for (content, expected) in [
        (
            &*in_inches,
            "trace.jsonl:1: \"inputs.files.object.model_unit\": unknown variant `inch`, expected one of `m`, `mm`, `cm`",
        ),
        ("", "empty, expected a trace"),
        ("{", "trace.jsonl:1: expected a line of a trace"),
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
        replay().fails(&[expected]);
    }
}

#[test]
fn a_pose_can_be_refined_in_place() {
    let scene = Scene::new().with("--output", "./init.json");
    scene.run().exits(0);
    assert_improved(&pose_of(&scene.json("init.json")), &truth());
    // The result can be refined again.
    scene.run().exits(0);
}

#[test]
fn other_poses_that_a_search_finds_are_written() {
    let scene = Scene::new()
        .with("--alternatives", "others.json")
        .with("--pipeline", "always.toml");
    let always = hybrid_icp::Preset::Search.toml();
    let limit = "good_enough = 0.02\n";
    let always = always.replace(limit, "good_enough = 0.0\nstart = \"ignored\"\n");
    scene.write("always.toml", always);
    scene.run().exits(0);
    let others = scene.json("others.json");
    let others = others.as_array().unwrap();
    assert!(!others.is_empty());
    let mut last = 0.0;
    for other in others {
        let number = |key: &str| other[key].as_f64().unwrap();
        assert!(number("score") >= last && number("mssd_mm") > 1.0);
        assert!(number("gap") <= number("score") && number("rotation_degrees") > 0.0);
        assert!(pose_of(other).translation.z > 0.0);
        last = number("score");
    }
}

#[test]
fn poses_of_declared_symmetries_are_no_look_alikes() {
    let scene = Scene::new();
    let mesh = Household::Carton.solid().to_mesh().unwrap();
    let depth = render_depth_image(&mesh, &camera(), &truth());
    hicp_io::write_ply(scene.path("obj_000007.ply"), &mesh, LengthUnit::Meters).unwrap();
    hicp_io::write_depth_png(scene.path("depth.png"), &depth, 0.1).unwrap();
    hicp_io::write_mask_png(scene.path("mask.png"), &Mask::measured(&depth)).unwrap();
    let scene = scene.with("--model", "obj_000007.ply");
    let alone = scene.result();
    assert!(alone["look_alikes"].as_f64().unwrap() > 0.5, "{alone}");

    let half_turn =
        |x: i32, y: i32, z: i32| json!([x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1]);
    let turns = [
        half_turn(1, -1, -1),
        half_turn(-1, 1, -1),
        half_turn(-1, -1, 1),
    ];
    let carton = json!({"diameter": 1, "symmetries_discrete": turns});
    let other = json!({"diameter": 1});
    scene.write("info.json", json!({"7": carton, "1": other}).to_string());
    let scene = scene
        .with("--symmetries", "info.json")
        .with("--trace", "trace.jsonl");
    let declared = scene.result();
    assert_eq!(declared["look_alikes"].as_f64(), Some(0.0), "{declared}");
    assert!(declared["confidence"].as_f64() > alone["confidence"].as_f64());
    // The diameter of 1 mm is that of no carton.
    let warning = declared["warnings"][0].as_str().unwrap();
    assert!(
        warning.contains("info.json: the stated diameter is 0.0010 m"),
        "{warning}"
    );
    scene
        .command("replay trace.jsonl")
        .exits(0)
        .prints(&["all equal"]);

    // One object fits a mesh of any name.
    scene.write("info.json", json!({"1": other}).to_string());
    scene
        .run()
        .fails(&["info.json", "obj_000007.ply", "no object 7"]);
    std::fs::rename(scene.path("obj_000007.ply"), scene.path("box.ply")).unwrap();
    let scene = scene.with("--model", "box.ply");
    scene.write("info.json", json!({"1": carton}).to_string());
    assert_eq!(scene.result()["look_alikes"].as_f64(), Some(0.0));
    scene.write("info.json", json!({"7": carton, "1": other}).to_string());
    scene.run().fails(&[
        "info.json: found 2 objects",
        "expected one, or a mesh with an id",
    ]);
}
