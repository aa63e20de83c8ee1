//! Scores of right, worse and missing estimates.

use super::*;

#[test]
fn the_truth_scores_one_on_every_metric() {
    let world = dataset();
    let report = report(&world, &truth_as_results(&world), "");
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
    let errors = world.read("errors.csv");
    assert_eq!(errors.lines().count(), 1 + 4 * 4 + 2);
    let columns = errors.lines().next().unwrap().split(',').count();
    for line in errors.lines().skip(1) {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        assert_eq!(cells.len(), columns);
    }

    let table = eval(&world, "").exits(0).out;
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 5);
    assert!(lines[4].starts_with("recall of MSSD below 2 mm 1.000, 4 mm 1.000"));
    for part in [&report, &report["objects"]["1"]] {
        assert_eq!(part["mssd_recall"], json!(1.0));
        assert_eq!(part["mssd_mm_recalls"], json!(vec![1.0; 10]));
    }
    assert!(lines[0].contains("MSSD") && lines[3].trim_start().starts_with("all"));
}

#[test]
fn neither_threads_nor_the_order_of_rows_change_a_byte() {
    let world = dataset();
    let mut rows = world.rows();
    report(&world, &rows, "--threads 1");
    let one = world.bytes("errors.csv");
    let recalls_of_one = world.json("out.json");
    report(&world, &rows, "--threads 3");
    assert_eq!(world.bytes("errors.csv"), one);
    // Of two estimates with equal scores, the first is preferred, so only estimates of different
    // objects may be exchanged.
    rows.sort_by_key(|row| row.obj_id);
    let sorted = report(&world, &rows, "");
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
        let report = report(&world, &off(mm), "");
        let ar = recalls(&report)[0];
        assert!(ar < before, "{mm} mm: {ar}");
        before = ar;
        let adi = report["median_adi_mm"].as_f64().unwrap();
        assert!(adi > 0.0 && adi <= mm, "{adi}");
    }

    // Half of the estimates are perfect, the others are missing.
    let half: Vec<_> = truth.iter().step_by(2).cloned().collect();
    let found = report(&world, &half, "");
    assert_eq!(recalls(&found), [0.5; 5]);
    assert_eq!(
        (&found["targets"], &found["missing"]),
        (&json!(10), &json!(5))
    );
    write_results(world.path("in.csv"), &[]).unwrap();
    eval(&world, "").warns(&["in.csv has no rows"]);
    let none = world.json("out.json");
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
        world.write("models/models_info.json", objects.to_string());
    };
    info(&json!([]));
    let declared_without = report(&world, &rows, "");
    assert!(recalls(&declared_without)[2] < 0.5);
    info(&json!([[-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]));
    let declared = report(&world, &rows, "");
    let [_, _, mssd, mspd, _] = recalls(&declared);
    assert_eq!((mssd, mspd), (1.0, 1.0));
    // AD is ADI for objects with declared symmetries. These objects are not symmetric, so ADI
    // differs from both ADD and a perfect score.
    let as_add = report(&world, &rows, "--symmetric 7");
    let as_adi = report(&world, &rows, "--symmetric 1,2");
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
    eval(&world, "").warns(&["warning: in.csv: 10 rows are ignored", "lowest scores"]);
    assert_eq!(recalls(&world.json("out.json")), [1.0; 5]);

    for row in &mut rows {
        row.score = 0.1;
    }
    write_results(world.path("in.csv"), &[worse, rows].concat()).unwrap();
    eval(&world, "").exits(0);
    assert_eq!(recalls(&world.json("out.json"))[2], 0.0);

    // The target means the more visible of two cars, and the visibilities are not stated.
    let target = r#"[{"scene_id": 3, "im_id": 0, "obj_id": 1, "inst_count": 1}]"#;
    world.write("test_targets_bop19.json", target);
    eval(&world, "").warns(&["scene_gt_info.json: no visib_fract of some instances"]);
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
    let run = eval(&world, "--calibration").exits(0);
    let found = world.json("out.json")["calibration"].clone();
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
        assert_eq!(line["estimates"], json!(10));
        for error in ["share_correct", "share_correct_mssd"] {
            assert_eq!(line[error], json!(share), "{error}");
        }
    };
    line(0.2, 0.1);
    line(0.9, 0.9);
    run.prints(&[
        "score against MSSD < 0.1 d: 20 estimates, 10 correct, ROC area 0.900",
        "score against ADI < 0.1 d: 10 correct, ROC area 0.900",
        "0.9-1.0         10",
    ]);

    // If all are correct, there is nothing to rank.
    write_results(world.path("in.csv"), &rows).unwrap();
    let run = eval(&world, "--calibration").exits(0);
    assert!(world.json("out.json")["calibration"]["roc_area"].is_null());
    run.prints(&["undefined"]);
    eval(&world, "").exits(0);
    assert!(world.json("out.json").get("calibration").is_none());
}
