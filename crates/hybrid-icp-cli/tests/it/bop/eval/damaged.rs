//! Rows, targets and files that do not match or are damaged.

use super::*;

/// With ten times the diameter, nearly every pose would count as correct.
#[test]
fn a_stated_diameter_that_differs_from_the_mesh_is_warned_of() {
    let world = dataset();
    write_results(world.path("in.csv"), &truth_as_results(&world)).unwrap();
    world.state_diameters(1500.0 / world.diameter_mm(CAR));
    let run = eval(&world, "").warns(&[
        "models_info.json: object 1: the stated diameter is 1.5000 m, but that of the mesh is 0.1",
        "check both, because poses, the MVE and recalls depend on it",
    ]);
    assert_eq!(run.err.lines().count(), 1, "{}", run.err);
    let warnings = &world.json("out.json")["warnings"];
    assert_eq!(
        run.err,
        format!("warning: {}\n", warnings[0].as_str().unwrap())
    );
}

#[test]
fn rows_and_targets_that_do_not_match_are_warned_of() {
    let world = dataset();
    let mut rows = truth_as_results(&world);
    let pose = rows[0].camera_from_object();
    rows.push(ResultRow::new(3, 0, ABSENT, pose));
    rows.push(ResultRow::new(77, 0, CAR, pose));
    write_results(world.path("in.csv"), &rows).unwrap();
    eval(&world, "").warns(&[
        "warning: in.csv: 2 of 12 rows have no target",
        "object 9 in image 0 of scene 3",
    ]);
    assert_eq!(recalls(&world.json("out.json")), [1.0; 5]);
    assert_eq!(
        world.json("out.json")["warnings"].as_array().unwrap().len(),
        1
    );

    // The targets name an object without a model, more instances than exist, and a missing image.
    let asked = |scene: u32, image: u32, object: u32, count: u32| json!({"scene_id": scene, "im_id": image, "obj_id": object, "inst_count": count});
    let targets = json!([
        asked(3, 0, CAR, 3),
        asked(3, 0, ABSENT, 1),
        asked(3, 7, CAR, 2),
        asked(55, 0, CAR, 4)
    ]);
    world.write("asked.json", targets.to_string());
    write_results(world.path("in.csv"), &truth_as_results(&world)).unwrap();
    let run = eval(&world, "--targets asked.json").warns(&[
        "no model for object 9, expected",
        "obj_000009.ply",
        "scene_gt.json",
        "2 instances of object 1, but the targets request 3",
        "8 of 10 rows have no target",
        "scene_camera.json, $: found 2 images, expected image 7",
        "and 1 more like it",
    ]);
    run.prints(&["8 targets could not be evaluated"]);
    let report = world.json("out.json");
    assert_eq!(
        (&report["targets"], &report["left_out"]),
        (&json!(2), &json!(8))
    );
    assert_eq!(recalls(&report), [1.0; 5]);

    // Masks are not required here, but masks of another size indicate wrong files.
    hicp_io::write_mask_png(world.mask_path(3, 0, 1), &Mask::full(32, 24)).unwrap();
    eval(&world, "").warns(&["000000_000001.png is 32x24", "expected 320x240"]);
}

#[test]
fn translations_in_meters_are_warned_of() {
    let world = dataset();
    let in_meters = truth_as_results(&world).into_iter().map(|row| {
        let mut pose = row.camera_from_object();
        pose.translation.vector *= 1e-3;
        ResultRow::new(row.scene_id, row.im_id, row.obj_id, pose)
    });
    write_results(world.path("in.csv"), &in_meters.collect::<Vec<_>>()).unwrap();
    let told = eval(&world, "").exits(0).err;
    assert_contains(&told, &["in.csv: all translations are below 20 mm"]);
}

#[test]
fn without_targets_every_visible_instance_is_a_target() {
    let world = dataset();
    world.remove("test_targets_bop19.json");
    write_results(world.path("in.csv"), &truth_as_results(&world)).unwrap();
    eval(&world, "").warns(&["warning: ", "test_targets_bop19.json does not exist"]);
    assert_eq!(world.json("out.json")["targets"], json!(10));

    // Those of the test images are not about another split, even if its numbers are the same.
    let targets = r#"[{"scene_id": 3, "im_id": 0, "obj_id": 1, "inst_count": 1}]"#;
    world.write("test_targets_bop19.json", targets);
    eval(&world, "").exits(0);
    assert_eq!(world.json("out.json")["targets"], json!(1));
    std::fs::rename(world.path("test"), world.path("val")).unwrap();
    eval(&world, "--split val")
        .warns(&["test_targets_bop19.json is not about the split val: every instance"]);
    assert_eq!(world.json("out.json")["targets"], json!(10));
    std::fs::rename(world.path("val"), world.path("test")).unwrap();
    world.remove("test_targets_bop19.json");

    // Of two cars, only the more visible one is a target; the other is visible by less than a
    // tenth.
    let visible = |a: f64, b: f64| json!([{"visib_fract": a}, {"visib_fract": b}]);
    let info = json!({"0": visible(0.05, 0.9)});
    world.write(world.scene(3).join("scene_gt_info.json"), info.to_string());
    eval(&world, "").exits(0);
    let report = world.json("out.json");
    assert_eq!(report["targets"], json!(9));
    // A scene without cameras, as that of another sensor, is left out.
    world.create_dir("test/000099");
    eval(&world, "").warns(&["test/000099/scene_camera.json", "the scene is left out"]);
    assert_eq!(world.json("out.json")["targets"], json!(9));
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
        let text = world.read(path);
        assert!(text.contains(from), "no {from} in {text}");
        text.replacen(from, to, 1).into_bytes()
    };
    let depth = world.depth_path(3, 40);
    let whole = world.bytes(&depth);
    for (path, content, parts, left) in [
        (
            depth.clone(),
            whole[..whole.len() / 3].to_vec(),
            &["000003/depth/000040.png"][..],
            7,
        ),
        (
            depth,
            world.bytes(eight_bit),
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
            &["scene_camera.json, $.0.cam_K", "fx is 0", "0.001 to"],
            8,
        ),
        (
            world.path("models/obj_000002.ply"),
            b"ply\n".to_vec(),
            &["obj_000002.ply"],
            8,
        ),
    ] {
        let before = world.bytes(&path);
        world.write(&path, content);
        let run = eval(&world, "").exits(1);
        let run = run
            .complains(parts)
            .complains(&["error: 1 file could not be used"]);
        let report = world.json("out.json");
        assert_eq!(report["targets"], json!(left), "{}", run.err);
        assert_eq!(recalls(&report), [1.0; 5]);
        run.prints(&[&format!("{} targets could not", 10 - left)]);
        world.write(&path, before);
    }

    // An image without depth counts as missing.
    let depth = world.depth_path(3, 0);
    let whole = world.bytes(&depth);
    world.remove(&depth);
    eval(&world, "").warns(&[
        "warning: depth image is missing",
        "000003/depth/000000.png does not exist",
    ]);
    assert_eq!(world.json("out.json")["left_out"], json!(2));
    // A scene without ground truth is reported once.
    let scene_gt = world.scene(3).join("scene_gt.json");
    std::fs::rename(&scene_gt, world.path("aside.json")).unwrap();
    let run = eval(&world, "").exits(0);
    assert_eq!(run.err.matches("scene_gt.json").count(), 1, "{}", run.err);
    assert_contains(&run.err, &["ground truth is missing"]);
    std::fs::rename(world.path("aside.json"), scene_gt).unwrap();
    // A depth image of the wrong size does not match its masks.
    std::fs::copy(small_path, &depth).unwrap();
    eval(&world, "")
        .warns(&["000000_000000.png is 320x240 pixels, expected 4x3 as the depth image"]);
    world.write(&depth, whole);

    world.write(
        "models/models_info.json",
        r#"{"1": {"diameter": 100, "symmetries_discrete": 3}}"#,
    );
    eval(&world, "")
        .fails(&["models_info.json, $.1.symmetries_discrete: found 3, expected an array"]);
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
        world.write("in.csv", text);
        let run = eval(&world, "").fails(parts);
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
        world.write("bad.json", text);
        eval(&world, "--targets bad.json").fails(parts);
    }
    world.write(
        "gone.json",
        r#"[{"scene_id": 99, "im_id": 0, "obj_id": 1, "inst_count": 1}]"#,
    );
    eval(&world, "--targets gone.json").fails(&["in.csv: none of", "rows has a target", "--split"]);
    let mut rows = truth_as_results(&world);
    rows.iter_mut()
        .for_each(|row| (row.scene_id, row.im_id, row.obj_id) = (99, 0, 1));
    write_results(world.path("in.csv"), &rows[..1]).unwrap();
    eval(&world, "--targets gone.json")
        .fails(&["none of the 1 targets could be evaluated", "--split"]);
    eval(&world, "--split tset").fails(&["split is missing", "tset"]);
    eval(&world, "--targets out.json").fails(&["--json", "--targets", "overwritten"]);
    for delta in ["0", "-1", "nan"] {
        eval(&world, &format!("--delta={delta}")).refuses(&["above 0"]);
    }
}
