//! `hybrid-icp bop eval` on a small dataset.

use std::f64::consts::PI;

use crate::common::*;
use crate::world::*;
use hicp_io::bop::{ResultRow, write_results};
use hybrid_icp::core::{DepthImage, Isometry3, Mask, Vector3};
use serde_json::{Value, json};

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
    std::fs::write(
        world.path("test_targets_bop19.json"),
        Value::from(targets).to_string(),
    )
    .unwrap();
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
fn eval(world: &World, options: &[&str]) -> Run {
    let fixed = "bop eval --dataset . --results in.csv --json out.json --errors errors.csv";
    run(
        world.folder.path(),
        fixed.split(' ').chain(options.iter().copied()),
    )
}

/// Evaluates rows, asserts that there is no message, and returns the report.
#[track_caller]
fn report(world: &World, rows: &[ResultRow], options: &[&str]) -> Value {
    write_results(world.path("in.csv"), rows).unwrap();
    let run = eval(world, options).exits(0);
    assert_eq!(run.err, "");
    read_json(world)
}

fn read_json(world: &World) -> Value {
    let text = std::fs::read_to_string(world.path("out.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Returns AR, AR_VSD, AR_MSSD, AR_MSPD and the recall of AD.
fn recalls(part: &Value) -> [f64; 5] {
    ["ar", "ar_vsd", "ar_mssd", "ar_mspd", "ad_recall"].map(|key| part[key].as_f64().unwrap())
}

#[test]
fn the_truth_scores_one_on_every_metric() {
    let world = dataset();
    let report = report(&world, &truth_as_results(&world), &[]);
    assert_eq!(recalls(&report), [1.0; 5]);
    assert_eq!(
        (&report["targets"], &report["missing"]),
        (&json!(10), &json!(0))
    );
    assert!(report["median_adi_mm"].as_f64().unwrap() < 1e-6);
    for (id, count) in [("1", 8), ("2", 2)] {
        assert_eq!(recalls(&report["objects"][id]), [1.0; 5]);
        assert_eq!(report["objects"][id]["targets"], json!(count));
    }

    // Each image has two cars: both are compared with both instances, the hammer with itself.
    let errors = std::fs::read_to_string(world.path("errors.csv")).unwrap();
    assert_eq!(errors.lines().count(), 1 + 4 * 4 + 2);
    let columns = errors.lines().next().unwrap().split(',').count();
    for line in errors.lines().skip(1) {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        assert_eq!(cells.len(), columns);
    }

    let table = eval(&world, &[]).exits(0).out;
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 5);
    assert!(lines[4].starts_with("recall of MSSD below 2 mm 1.000, 4 mm 1.000"));
    for part in [&report, &report["objects"]["1"]] {
        assert_eq!(part["mssd_recall"], json!(1.0));
        assert_eq!(part["mssd_mm_recalls"], json!(vec![1.0; 10]));
    }
    assert!(lines[0].contains("MSSD") && lines[3].trim_start().starts_with("all"));
}

/// With ten times the diameter, nearly every pose would count as correct.
#[test]
fn a_stated_diameter_that_differs_from_the_mesh_is_warned_of() {
    let world = dataset();
    write_results(world.path("in.csv"), &truth_as_results(&world)).unwrap();
    let info = json!({"1": {"diameter": 1500.0}}).to_string();
    std::fs::write(world.path("models/models_info.json"), info).unwrap();
    let run = eval(&world, &[]).exits(0).complains(&[
        "models_info.json: object 1: the stated diameter is 1.5000 m, but that of the mesh is 0.1",
        "check both, because poses, the MVE and recalls depend on it",
    ]);
    assert_eq!(run.err.lines().count(), 1, "{}", run.err);
    let warnings = &read_json(&world)["warnings"];
    assert_eq!(
        run.err,
        format!("warning: {}\n", warnings[0].as_str().unwrap())
    );
}

#[test]
fn neither_threads_nor_the_order_of_rows_change_a_byte() {
    let world = dataset();
    let mut rows = world.rows();
    report(&world, &rows, &["--threads", "1"]);
    let one = std::fs::read(world.path("errors.csv")).unwrap();
    let recalls_of_one = read_json(&world);
    report(&world, &rows, &["--threads", "3"]);
    assert_eq!(std::fs::read(world.path("errors.csv")).unwrap(), one);
    // Of two estimates with equal scores, the first is preferred, so only estimates of different
    // objects may be exchanged.
    rows.sort_by_key(|row| row.obj_id);
    let sorted = report(&world, &rows, &[]);
    assert_eq!(recalls(&sorted), recalls(&recalls_of_one));
}

#[test]
fn worse_estimates_have_lower_recalls_and_missing_ones_count() {
    let world = dataset();
    let truth = truth_as_results(&world);
    let off = |mm: f64| -> Vec<ResultRow> {
        let mut rows = truth.clone();
        for row in &mut rows {
            let pose = row.camera_from_object();
            row.set_camera_from_object(Isometry3::translation(0.0, 0.0, 1e-3 * mm) * pose);
        }
        rows
    };
    let mut before = 1.0 + f64::EPSILON;
    for mm in [2.0, 20.0, 60.0] {
        let report = report(&world, &off(mm), &[]);
        let ar = recalls(&report)[0];
        assert!(ar < before, "{mm} mm: {ar}");
        before = ar;
        let adi = report["median_adi_mm"].as_f64().unwrap();
        assert!(adi > 0.0 && adi <= mm, "{adi}");
    }

    // Half of the estimates are perfect, the others are missing.
    let half: Vec<_> = truth.iter().step_by(2).cloned().collect();
    let found = report(&world, &half, &[]);
    assert_eq!(recalls(&found), [0.5; 5]);
    assert_eq!(
        (&found["targets"], &found["missing"]),
        (&json!(10), &json!(5))
    );
    let none = report(&world, &[], &[]);
    assert_eq!(recalls(&none), [0.0; 5]);
    assert_eq!(
        (&none["missing"], &none["median_adi_mm"]),
        (&json!(10), &Value::Null)
    );
}

#[test]
fn a_symmetric_equivalent_scores_one_on_mssd_and_mspd() {
    let world = dataset();
    let half_turn = Isometry3::new(Vector3::zeros(), Vector3::new(0.0, 0.0, PI));
    let mut rows = truth_as_results(&world);
    for row in &mut rows {
        row.set_camera_from_object(row.camera_from_object() * half_turn);
    }
    let info = |symmetries: &Value| {
        let objects = json!({
            "1": {"diameter": world.diameter_mm(CAR), "symmetries_discrete": symmetries},
            "2": {"diameter": world.diameter_mm(HAMMER), "symmetries_discrete": symmetries},
        });
        std::fs::write(world.path("models/models_info.json"), objects.to_string()).unwrap();
    };
    info(&json!([]));
    let declared_without = report(&world, &rows, &[]);
    assert!(recalls(&declared_without)[2] < 0.5);
    info(&json!([[-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]));
    let declared = report(&world, &rows, &[]);
    let [_, _, mssd, mspd, _] = recalls(&declared);
    assert_eq!((mssd, mspd), (1.0, 1.0));
    // AD is ADI for objects with declared symmetries. These objects are not symmetric, so ADI
    // differs from both ADD and a perfect score.
    let as_add = report(&world, &rows, &["--symmetric", "7"]);
    let as_adi = report(&world, &rows, &["--symmetric", "1,2"]);
    assert_eq!(as_adi, declared);
    assert!(recalls(&as_add)[4] <= recalls(&as_adi)[4]);
}

#[test]
fn only_the_best_scores_are_evaluated() {
    let world = dataset();
    let mut rows = truth_as_results(&world);
    let mut worse = rows.clone();
    for row in &mut worse {
        let pose = row.camera_from_object();
        row.score = 0.5;
        row.set_camera_from_object(Isometry3::translation(0.0, 0.0, 0.5) * pose);
    }
    // There are ten perfect rows and ten bad ones. The bad ones come first and have lower scores.
    let together = [worse.clone(), rows.clone()].concat();
    write_results(world.path("in.csv"), &together).unwrap();
    eval(&world, &[])
        .exits(0)
        .complains(&["warning: in.csv: 10 rows are ignored", "lowest scores"]);
    assert_eq!(recalls(&read_json(&world)), [1.0; 5]);

    for row in &mut rows {
        row.score = 0.1;
    }
    write_results(world.path("in.csv"), &[worse, rows].concat()).unwrap();
    eval(&world, &[]).exits(0);
    assert_eq!(recalls(&read_json(&world))[2], 0.0);
}

#[test]
fn rows_and_targets_that_do_not_match_are_warned_of() {
    let world = dataset();
    let mut rows = truth_as_results(&world);
    let pose = rows[0].camera_from_object();
    rows.push(ResultRow::new(3, 0, ABSENT, pose));
    rows.push(ResultRow::new(77, 0, CAR, pose));
    write_results(world.path("in.csv"), &rows).unwrap();
    eval(&world, &[]).exits(0).complains(&[
        "warning: in.csv: 2 of 12 rows have no target",
        "object 9 in image 0 of scene 3",
    ]);
    assert_eq!(recalls(&read_json(&world)), [1.0; 5]);
    assert_eq!(read_json(&world)["warnings"].as_array().unwrap().len(), 1);

    // The targets name an object without a model, more instances than exist, and a missing image.
    let asked = |scene: u32, image: u32, object: u32, count: u32| json!({"scene_id": scene, "im_id": image, "obj_id": object, "inst_count": count});
    let targets = json!([
        asked(3, 0, CAR, 3),
        asked(3, 0, ABSENT, 1),
        asked(3, 7, CAR, 2),
        asked(55, 0, CAR, 4)
    ]);
    std::fs::write(world.path("asked.json"), targets.to_string()).unwrap();
    write_results(world.path("in.csv"), &truth_as_results(&world)).unwrap();
    let run = eval(&world, &["--targets", "asked.json"])
        .exits(0)
        .complains(&[
            "no model for object 9",
            "scene_gt.json",
            "2 instances of object 1, but the targets request 3",
            "8 of 10 rows have no target",
            "scene_camera.json, $: found 2 images, expected image 7",
            "and 1 more like it",
        ]);
    assert!(
        run.out.contains("8 targets could not be evaluated"),
        "{}",
        run.out
    );
    let report = read_json(&world);
    assert_eq!(
        (&report["targets"], &report["left_out"]),
        (&json!(2), &json!(8))
    );
    assert_eq!(recalls(&report), [1.0; 5]);

    // Masks are not required here, but masks of another size indicate wrong files.
    hicp_io::write_mask_png(world.mask_path(3, 0, 1), &Mask::full(32, 24)).unwrap();
    eval(&world, &[])
        .exits(0)
        .complains(&["000000_000001.png is 32x24", "expected 320x240"]);
}

#[test]
fn without_targets_every_visible_instance_is_a_target() {
    let world = dataset();
    std::fs::remove_file(world.path("test_targets_bop19.json")).unwrap();
    write_results(world.path("in.csv"), &truth_as_results(&world)).unwrap();
    eval(&world, &[])
        .exits(0)
        .complains(&["warning: ", "test_targets_bop19.json does not exist"]);
    assert_eq!(read_json(&world)["targets"], json!(10));

    // Of two cars, only the more visible one is a target; the other is visible by less than a
    // tenth.
    let visible = |a: f64, b: f64| json!([{"visib_fract": a}, {"visib_fract": b}]);
    let info = json!({"0": visible(0.05, 0.9)});
    std::fs::write(world.scene(3).join("scene_gt_info.json"), info.to_string()).unwrap();
    eval(&world, &[]).exits(0);
    let report = read_json(&world);
    assert_eq!(report["targets"], json!(9));
    // Rows are in the inverse order of the ground truth, so the first row is the visible car.
    assert_eq!(recalls(&report), [1.0; 5]);
}

#[test]
fn damaged_files_are_reported_and_the_rest_is_evaluated() {
    let world = dataset();
    write_results(world.path("in.csv"), &truth_as_results(&world)).unwrap();
    let scene_gt = world.scene(12).join("scene_gt.json");
    let camera = world.scene(3).join("scene_camera.json");
    let small = DepthImage::from_meters(4, 3, vec![1.0; 12]).unwrap();
    let eight_bit = world.path("eight.png");
    hicp_io::write_mask_png(&eight_bit, &Mask::full(320, 240)).unwrap();
    let small_path = world.path("small.png");
    hicp_io::write_depth_png(&small_path, &small, 0.1).unwrap();
    let replaced = |path: &std::path::Path, from: &str, to: &str| {
        let text = std::fs::read_to_string(path).unwrap();
        assert!(text.contains(from), "no {from} in {text}");
        text.replacen(from, to, 1).into_bytes()
    };
    let depth = world.depth_path(3, 40);
    let whole = std::fs::read(&depth).unwrap();
    for (path, content, parts, left) in [
        (
            depth.clone(),
            whole[..whole.len() / 3].to_vec(),
            &["000003/depth/000040.png"][..],
            7,
        ),
        (
            depth,
            std::fs::read(eight_bit).unwrap(),
            &["000040.png: found 8-bit", "expected 16-bit"],
            7,
        ),
        // The value is a number instead of a list.
        (
            scene_gt.clone(),
            br#"{"0": 5}"#.to_vec(),
            &["scene_gt.json, $.0: found 5, expected an array"],
            5,
        ),
        (
            scene_gt,
            replaced(
                &world.scene(12).join("scene_gt.json"),
                "\"obj_id\":1",
                "\"obj_id\":-1",
            ),
            &["scene_gt.json, $.0[0].obj_id: found -1"],
            5,
        ),
        (
            camera.clone(),
            replaced(&camera, "[400,0,161.5,0,402,118,0,0,1]", "400"),
            &["scene_camera.json, $.0.cam_K: found 400, expected an array of 9 numbers"],
            5,
        ),
        (
            camera.clone(),
            replaced(&camera, "[400,", "[0,"),
            &["scene_camera.json, $.0.cam_K", "fx is 0", "above 0"],
            8,
        ),
        (
            world.path("models/obj_000002.ply"),
            b"ply\n".to_vec(),
            &["obj_000002.ply"],
            8,
        ),
    ] {
        let before = std::fs::read(&path).unwrap();
        std::fs::write(&path, content).unwrap();
        let run = eval(&world, &[]).exits(1);
        let run = run
            .complains(parts)
            .complains(&["error: 1 files could not be used"]);
        let report = read_json(&world);
        assert_eq!(report["targets"], json!(left), "{}", run.err);
        assert_eq!(recalls(&report), [1.0; 5]);
        assert!(
            run.out
                .contains(&format!("{} targets could not", 10 - left)),
            "{}",
            run.out
        );
        std::fs::write(&path, before).unwrap();
    }

    // An image without depth counts as missing.
    let depth = world.depth_path(3, 0);
    let whole = std::fs::read(&depth).unwrap();
    std::fs::remove_file(&depth).unwrap();
    eval(&world, &[]).exits(0).complains(&[
        "warning: depth image is missing",
        "000003/depth/000000.png does not exist",
    ]);
    assert_eq!(read_json(&world)["left_out"], json!(2));
    // A depth image of the wrong size does not match its masks.
    std::fs::copy(small_path, &depth).unwrap();
    eval(&world, &[])
        .exits(0)
        .complains(&["000000_000000.png is 320x240 pixels, expected 4x3 as the depth image"]);
    std::fs::write(&depth, whole).unwrap();

    std::fs::write(
        world.path("models/models_info.json"),
        r#"{"1": {"diameter": 100, "symmetries_discrete": 3}}"#,
    )
    .unwrap();
    eval(&world, &[])
        .exits(1)
        .complains(&["models_info.json, $.1.symmetries_discrete: found 3, expected an array"]);
}

#[test]
fn bad_results_and_targets_name_their_place() {
    let world = dataset();
    let header = "scene_id,im_id,obj_id,score,R,t,time\n";
    for (text, parts) in [
        (
            "scene_id,im_id,obj_id,score,R,t\n".to_owned(),
            &["in.csv, line 1", "\"time\" appears 0 times"][..],
        ),
        (
            format!("{header}3,0,1,nan,1 0 0 0 1 0 0 0 1,0 0 500,-1\n"),
            &[
                "in.csv, line 2, column \"score\"",
                "\"nan\"",
                "finite number",
            ],
        ),
        (
            format!("{header}3,0,1,1,1 0 0 0 1 0 0 0 1,0 0 NaN,-1\n"),
            &["line 2, column \"t\"", "\"0 0 NaN\"", "3 finite numbers"],
        ),
        (
            format!("{header}3,0,1,1,1 00 0 1 0 0 0 1,0 0 500,-1\n"),
            &[
                "line 2, column \"R\"",
                "\"1 00 0 1 0 0 0 1\"",
                "9 finite numbers separated by spaces",
            ],
        ),
        (
            format!("{header}3,0,1,1,100010001,0 0 500,-1\n"),
            &[
                "line 2, column \"R\"",
                "\"100010001\"",
                "9 finite numbers separated by spaces",
            ],
        ),
        (
            format!("{header}3,0,car,1,1 0 0 0 1 0 0 0 1,0 0 500,-1\n"),
            &["line 2, column \"obj_id\"", "\"car\"", "integer"],
        ),
    ] {
        std::fs::write(world.path("in.csv"), text).unwrap();
        let run = eval(&world, &[]).exits(1).complains(parts);
        assert_eq!(run.out, "");
    }
    write_results(world.path("in.csv"), &truth_as_results(&world)).unwrap();
    let target = r#"{"scene_id": 3, "im_id": 0, "obj_id": 1, "inst_count": 1}"#;
    for (text, parts) in [
        (
            format!("[{target}, {target}]"),
            &["bad.json: object 1 in image 0 of scene 3 appears twice"][..],
        ),
        ("[]".to_owned(), &["bad.json has no target"]),
        ("7".to_owned(), &["bad.json, $: found 7, expected an array"]),
        (
            target.replace(": 1}", ": \"one\"}").replace('{', "[{") + "]",
            &["bad.json, $[0].inst_count: found the text \"one\""],
        ),
        (
            r#"[{"scene_id": 3, "im_id": 0}]"#.to_owned(),
            &["bad.json, $[0]", "`obj_id`"],
        ),
        ("[NaN]".to_owned(), &["bad.json, line 1, column 2"]),
    ] {
        std::fs::write(world.path("bad.json"), text).unwrap();
        eval(&world, &["--targets", "bad.json"])
            .exits(1)
            .complains(parts);
    }
    std::fs::write(
        world.path("gone.json"),
        r#"[{"scene_id": 99, "im_id": 0, "obj_id": 1, "inst_count": 1}]"#,
    )
    .unwrap();
    eval(&world, &["--targets", "gone.json"])
        .exits(1)
        .complains(&["in.csv: none of", "rows has a target", "--split"]);
    let mut rows = truth_as_results(&world);
    rows.iter_mut()
        .for_each(|row| (row.scene_id, row.im_id, row.obj_id) = (99, 0, 1));
    write_results(world.path("in.csv"), &rows[..1]).unwrap();
    eval(&world, &["--targets", "gone.json"])
        .exits(1)
        .complains(&["none of the 1 targets could be evaluated", "--split"]);
    eval(&world, &["--split", "tset"])
        .exits(1)
        .complains(&["split is missing", "tset"]);
    eval(&world, &["--targets", "out.json"])
        .exits(1)
        .complains(&["--json", "--targets", "overwritten"]);
    for delta in ["0", "-1", "nan"] {
        eval(&world, &[&format!("--delta={delta}")])
            .exits(2)
            .complains(&["above 0"]);
    }
}

#[test]
fn scores_are_compared_with_correctness() {
    let world = dataset();
    // There are ten correct rows and ten that are half a meter off. One row of each kind has the
    // score of the other kind.
    let mut rows = truth_as_results(&world);
    let mut wrong = rows.clone();
    for row in &mut rows {
        row.score = 0.95;
    }
    for row in &mut wrong {
        row.score = 0.25;
        row.set_camera_from_object(
            Isometry3::translation(0.0, 0.0, 0.5) * row.camera_from_object(),
        );
    }
    (rows[3].score, wrong[7].score) = (0.25, 0.95);
    // Rows without an image or an object are left out.
    let pose = rows[0].camera_from_object();
    let strangers = [
        ResultRow::new(3, 77, CAR, pose),
        ResultRow::new(3, 0, HAMMER, pose),
    ];
    write_results(
        world.path("in.csv"),
        &[&rows[..], &wrong, &strangers].concat(),
    )
    .unwrap();
    let run = eval(&world, &["--calibration"]).exits(0);
    let found = read_json(&world)["calibration"].clone();
    // Of 100 pairs, 81 are in order, 18 are ties, and one is in reverse.
    assert_eq!(found["roc_area"], json!(0.9));
    assert_eq!(
        (&found["estimates"], &found["correct"]),
        (&json!(20), &json!(10))
    );
    let line = |lower: f64, share: f64| {
        let table = found["reliability"].as_array().unwrap();
        let line = table.iter().find(|line| line["lower"] == json!(lower));
        let line = line.unwrap();
        assert_eq!(
            (&line["estimates"], &line["share_correct"]),
            (&json!(10), &json!(share))
        );
    };
    line(0.2, 0.1);
    line(0.9, 0.9);
    for part in [
        "20 estimates, 10 correct, ROC area 0.900",
        "0.9-1.0         10",
        "score against MSSD < 0.1 d: ",
    ] {
        assert!(run.out.contains(part), "no {part:?} in {}", run.out);
    }

    // If all are correct, there is nothing to rank.
    write_results(world.path("in.csv"), &rows).unwrap();
    let run = eval(&world, &["--calibration"]).exits(0);
    assert!(read_json(&world)["calibration"]["roc_area"].is_null());
    assert!(run.out.contains("undefined"), "{}", run.out);
    eval(&world, &[]).exits(0);
    assert!(read_json(&world).get("calibration").is_none());
}
