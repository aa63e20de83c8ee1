//! `hybrid-icp bop refine` on a small dataset.

use std::collections::BTreeMap;

use crate::common::*;
use hicp_io::bop::{ResultRow, read_results, write_results};
use hybrid_icp::core::{Isometry3, Mask};
use serde_json::{Value, json};

#[test]
fn every_row_is_refined_against_its_own_instance() {
    let world = World::new();
    let rows = world.rows();
    let (run, refined) = world.refine(&rows, "");
    let run = run.exits(0);
    assert_eq!(run.err, "");
    run.prints(&["10 rows of 4 frames"]);
    assert!(run.out.contains("10  refined") && run.out.contains("median MVE"));
    for (before, after) in rows.iter().zip(&refined) {
        world.assert_refined(before, after);
    }
    let text = world.read("out.csv");
    assert!(text.starts_with("scene_id,im_id,obj_id,score,R,t,time\n"));
    assert!(!text.contains("NaN") && !text.contains("inf"));
}

#[test]
fn other_hypotheses_follow_the_rows() {
    let world = World::new();
    let rows = world.rows();
    let search = "--pipeline search --no-time --set threshold=0";
    let refined = world.refined(&rows, search);
    let run = world.run(&format!("{search} --hypotheses 3")).exits(0);
    run.prints(&["10 rows of 4 frames"]);
    let all = read_results(world.path("out.csv")).unwrap();
    assert_eq!(all[..rows.len()], refined);
    let others = &all[rows.len()..];
    assert!(!others.is_empty() && others.len() <= 2 * rows.len());
    for other in others {
        let same = |row: &&ResultRow| {
            (row.scene_id, row.im_id, row.obj_id) == (other.scene_id, other.im_id, other.obj_id)
        };
        // An image has two cars, and an evaluation asks for their own poses first.
        let of_image = refined.iter().filter(same);
        let lowest = of_image.map(|row| row.score).fold(1.0, f64::min);
        assert!(other.score <= lowest);
        assert!(
            refined
                .iter()
                .all(|r| r.camera_from_object() != other.camera_from_object())
        );
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let world = World::new();
    let rows = world.rows();
    let mut outputs = Vec::new();
    for threads in [1, 2, 7] {
        let refined = world.refined(&rows, &format!("--no-time --threads {threads}"));
        assert!(refined.iter().all(|row| row.time_s.is_none()));
        outputs.push(world.bytes("out.csv"));
    }
    assert!(outputs.iter().all(|output| output == &outputs[0]));
    let text = String::from_utf8(outputs.remove(0)).unwrap();
    assert!(text.lines().skip(1).all(|line| line.ends_with(",-1")));
}

#[test]
fn the_time_is_the_same_on_all_rows_of_an_image() {
    let world = World::new();
    let mut rows = world.rows();
    // The time is added to the time in the input. If the rows of an image differ, or if only some
    // have a time, the largest counts.
    for (index, row) in rows.iter_mut().enumerate() {
        row.time_s = match row.scene_id {
            3 => Some(100.0),
            _ if row.im_id == 40 => (index % 2 == 0).then_some(10.0 + index as f64),
            _ => None,
        };
    }
    let refined = world.refined(&rows, "");
    let mut times: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    for row in &refined {
        let time = row.time_s.unwrap();
        assert_eq!(
            *times.entry((row.scene_id, row.im_id)).or_insert(time),
            time
        );
    }
    for ((scene, image), time) in times {
        let stated = rows
            .iter()
            .filter(|r| (r.scene_id, r.im_id) == (scene, image));
        let stated = stated.filter_map(|r| r.time_s).fold(0.0, f64::max);
        assert!(
            time > stated && time < stated + 10.0,
            "{scene} {image}: {time}"
        );
    }
}

#[test]
fn rows_that_cannot_be_refined_are_kept_and_counted() {
    let world = World::new();
    let mut rows = world.rows();
    let refinable = rows.len();
    let pose = rows[0].camera_from_object();
    let aside = Isometry3::translation(0.0, 3.0, 0.0) * pose;
    let behind = Isometry3::translation(0.0, 0.0, -3.0) * pose;
    rows.insert(0, ResultRow::new(3, 0, ABSENT, pose));
    rows.insert(4, ResultRow::new(3, 0, HAMMER, pose));
    rows.push(ResultRow::new(3, 0, CAR, aside));
    rows.push(ResultRow::new(12, 0, CAR, behind));
    rows.push(ResultRow::new(3, 77, CAR, pose));
    rows.push(ResultRow::new(44, 0, CAR, pose));
    for row in &mut rows {
        row.score = 0.123_456_789;
    }
    let (run, refined) = world.refine(&rows, "");
    let run = run.exits(0);
    run.prints(&[
        "10  refined",
        "1  kept: missing model (object 9)",
        "1  kept: no mask of the object",
        "2  kept: no overlap with a mask of the object",
        "2  kept: missing frame",
    ]);
    let warnings: Vec<&str> = run.err.lines().collect();
    assert_eq!(warnings.len(), 2, "{}", run.err);
    assert!(warnings.iter().all(|line| line.starts_with("warning: ")));
    assert!(warnings[0].contains("obj_000009.ply"), "{}", run.err);
    let kept = rows
        .iter()
        .zip(&refined)
        .filter(|(a, b)| same_pose(a, b))
        .count();
    assert_eq!(kept, rows.len() - refinable);
    // Nothing was computed for these rows, so their time is unknown.
    for row in &refined[rows.len() - 2..] {
        assert_eq!(row.time_s, None);
    }

    // The numbers are those of the file, although its rotation is orthogonal to only nine digits.
    let numbers = "0.768311175 -0.0665434694 0.636608126 0.311033385 0.908074697 -0.280461366 -0.559424858 0.413487982 0.718381178,78.6667817 -7.67105284 1035.65777";
    let text = format!("scene_id,im_id,obj_id,score,R,t,time\n3,0,9,0.5,{numbers},1.25\n");
    world.write("in.csv", &text);
    world.run("").exits(0);
    assert_eq!(world.read("out.csv"), text);
}

#[test]
fn missing_files_cost_their_rows_only() {
    let world = World::new();
    let rows = world.rows();
    world.remove(world.depth_path(3, 0));
    world.remove(world.mask_path(12, 40, 1));
    // One of two cars loses its mask, so its row overlaps no mask.
    world.remove(world.mask_path(12, 0, 0));
    let (run, refined) = world.refine(&rows, "");
    let run = run.warns(&[
        "warning: depth image is missing: ./test/000003/depth/000000.png",
        "warning: mask is missing: ./test/000012/mask_visib/0000",
        "(and 1 more like it)",
    ]);
    run.prints(&[
        "6  refined",
        "2  kept: missing frame",
        "1  kept: no mask",
        "1  kept: no overlap",
    ]);
    for (before, after) in rows.iter().zip(&refined) {
        if !same_pose(before, after) {
            world.assert_refined(before, after);
        }
        if (before.scene_id, before.im_id) == (3, 0) {
            assert!(same_pose(before, after) && after.time_s.is_none());
        }
    }
}

#[test]
fn missing_ground_truth_is_reported_if_masks_depend_on_it() {
    let world = World::new();
    let rows = world.rows();
    let path = world.scene(3).join("scene_gt.json");
    world.replace(&path, "\"40\":", "\"41\":");
    let (run, _) = world.refine(&rows, "");
    let run = run.warns(&[
        "warning: ground truth is missing: ./test/000003/scene_gt.json does not have image 40",
    ]);
    run.prints(&["3  kept: no mask"]);
    world.remove(&path);
    let (run, _) = world.refine(&rows, "");
    run.prints(&["5  kept: no mask"]);
    // It is missing for both images, but reported once.
    assert_eq!(
        run.exits(0).err,
        "warning: ground truth is missing: ./test/000003/scene_gt.json does not exist\n\
         warning: rows without a mask of the ground truth need --detections FILE or --mask none\n"
    );
    // With masks from a file, it is not required.
    let (run, _) = world.refine(&rows, "--mask none");
    assert_eq!(run.exits(0).err, "");
}

#[cfg(target_os = "linux")]
#[test]
fn errors_are_reported_even_if_the_summary_cannot_be_written() {
    if !std::path::Path::new("/dev/full").exists() {
        println!("skipped: no /dev/full");
        return;
    }
    let world = World::new();
    write_results(world.path("in.csv"), &world.rows()).unwrap();
    let depth = world.depth_path(3, 40);
    world.write(&depth, "no image");
    world.remove(world.depth_path(12, 40));
    let words = "bop refine --dataset . --results in.csv --output out.csv --no-time";
    let told = || {
        let full = std::fs::File::options().write(true).open("/dev/full");
        let mut command = program(world.root());
        command.args(words.split(' ')).stdout(full.unwrap());
        Run::from(command.output().unwrap()).exits(1)
    };
    told().complains(&[
        "warning: depth image is missing",
        "error: ./test/000003/depth/000040.png",
        "error: 1 file could not be used",
    ]);
    // Without the damaged file, the summary is the only error.
    world.remove(&depth);
    told().complains(&["warning: depth", "error: cannot write to standard output"]);
}

#[test]
fn damaged_files_are_reported_and_the_rest_is_written() {
    let world = World::new();
    let rows = world.rows();
    for (path, name) in [
        (world.depth_path(3, 40), "000003/depth/000040.png"),
        (
            world.mask_path(12, 40, 1),
            "000012/mask_visib/000040_000001.png",
        ),
        (world.path("models/obj_000001.ply"), "obj_000001.ply"),
        (world.scene(12).join("scene_gt.json"), "scene_gt.json"),
    ] {
        let whole = world.bytes(&path);
        world.write(&path, &whole[..whole.len() / 3]);
        let (run, refined) = world.refine(&rows, "");
        let run = run.fails(&["error: ", name, "1 file could not be used", "out.csv"]);
        run.prints(&["kept: damaged file"]);
        let changed = rows.iter().zip(&refined).filter(|(a, b)| !same_pose(a, b));
        let changed: Vec<_> = changed.collect();
        assert!(!changed.is_empty() && changed.len() < rows.len());
        for (before, after) in changed {
            world.assert_refined(before, after);
        }
        // An unreadable file does not count as missing.
        world.remove(&path);
        world.create_dir(&path);
        let (run, _) = world.refine(&rows, "");
        let run = run.fails(&["error: ", name, "a folder"]);
        run.prints(&["kept: damaged file"]);
        std::fs::remove_dir(&path).unwrap();
        world.write(&path, whole);
    }

    let small = Mask::full(32, 24);
    hicp_io::write_mask_png(world.mask_path(12, 40, 1), &small).unwrap();
    let (run, _) = world.refine(&rows, "");
    run.fails(&["000040_000001.png is 32x24", "000040.png is 320x240"]);

    let camera = world.scene(3).join("scene_camera.json");
    world.replace(&camera, "400", "0");
    let (run, _) = world.refine(&rows, "");
    run.fails(&["scene_camera.json", "$.0.cam_K", "fx is 0", "0.001 to"]);
}

#[test]
fn masks_of_a_detections_file_are_the_same_masks() {
    let world = World::new();
    let rows = world.rows();
    let reference = world.refined(&rows, "--no-time");
    for compressed in [true, false] {
        let mut detections = world.detections(|_| compressed);
        // A detection without a segmentation and a box is ignored.
        detections.push(json!({"scene_id": 3, "image_id": 0, "category_id": 1, "score": 1}));
        world.write("found.json", Value::from(detections).to_string());
        let refined = world.refined(&rows, "--no-time --detections found.json");
        assert_eq!(refined, reference);

        // Detections work without ground truth.
        for scene in [3, 12] {
            let file = world.scene(scene).join("scene_gt.json");
            let aside = file.with_extension("aside");
            if file.is_file() {
                std::fs::rename(file, aside).unwrap();
            }
        }
        let refined = world.refined(&rows, "--no-time --detections found.json");
        assert_eq!(refined, reference);
        let (run, _) = world.refine(&rows, "");
        assert!(run.exits(0).out.contains("10  kept: no mask of the object"));
        for scene in [3, 12] {
            let file = world.scene(scene).join("scene_gt.json");
            std::fs::rename(file.with_extension("aside"), file).unwrap();
        }
    }
    // The box of a detection is used if it has no segmentation, and no detection is an error.
    let mut detections = world.detections(|_| true).into_iter();
    let hammer = detections.find(|found| found["category_id"] == HAMMER);
    let mut detections = json!([hammer.unwrap()]);
    detections[0]
        .as_object_mut()
        .unwrap()
        .remove("segmentation");
    world.write("found.json", detections.to_string());
    let told = world.run("--detections found.json").exits(0).out;
    assert_contains(&told, &["1  refined", "9  kept: no mask"]);
    detections[0]["image_id"] = json!(41);
    world.write("found.json", detections.to_string());
    world
        .run("--detections found.json")
        .fails(&["in.csv: none of its rows has a detection", "image_id"]);
    let outline = |size: [u32; 2], counts: &[u32]| {
        let segmentation = json!({"size": size, "counts": counts});
        let detection = json!([{"scene_id": 3, "image_id": 0, "category_id": 1, "score": 1, "segmentation": segmentation}]);
        world.write("found.json", detection.to_string());
        world.run("--detections found.json")
    };
    let parts = [
        "found.json",
        "$[0].segmentation",
        "cover 7 pixels",
        "expected 76800",
    ];
    outline([240, 320], &[7]).fails(&parts);
    outline([1, 7], &[0, 7]).fails(&["7x1", "320x240", "--detections"]);
}

#[test]
fn failures_before_the_refinement_change_no_file() {
    let world = World::new();
    let rows = world.rows();
    write_results(world.path("in.csv"), &rows).unwrap();
    world.write("out.csv", "the user's");
    let fails = |options: &str, parts: &[&str]| {
        let told = world.command(format!("bop refine {options}")).fails(parts);
        assert_eq!(told.out, "");
        assert_eq!(world.bytes("out.csv"), b"the user's");
    };
    fails(
        "--dataset gone --results in.csv --output out.csv",
        &["dataset folder", "gone"],
    );
    fails(
        "--dataset . --results in.csv --output out.csv --split tset",
        &["split is missing", "tset", "--split to name one of: test"],
    );
    fails(
        "--dataset ./test --results in.csv --output out.csv",
        &[
            "split is missing",
            "--dataset to name the folder with models/ and test/",
        ],
    );
    fails(
        "--dataset . --results gone.csv --output out.csv",
        &["cannot read gone.csv"],
    );
    fails(
        "--dataset . --results in.csv --output no/out.csv",
        &["cannot write no/out.csv", "folder no does not exist"],
    );
    fails(
        "--dataset . --results in.csv --output out.csv --detections out.csv",
        &["--output", "--detections", "overwritten"],
    );
    let text = world.read("in.csv");
    let damaged = |from: &str, to: &str| text.replacen(from, to, 1);
    let reflected = "scene_id,im_id,obj_id,score,R,t,time\n3,0,1,1,1 0 0 0 1 0 0 0 -1,0 0 500,-1\n";
    for (text, parts) in [
        (
            damaged("scene_id,", ""),
            &["bad.csv", "line 1", "scene_id"][..],
        ),
        (
            damaged(",-1\n", ",soon\n"),
            &["bad.csv", "line 2", "\"time\"", "\"soon\"", "seconds"],
        ),
        (
            damaged("\n12,", "\nx,"),
            &["bad.csv", "\"scene_id\"", "\"x\"", "integer"],
        ),
        (
            reflected.to_owned(),
            &["bad.csv", "line 2", "\"R\"", "determinant -1"],
        ),
    ] {
        world.write("bad.csv", text);
        fails("--dataset . --results bad.csv --output out.csv", parts);
    }
}

#[test]
fn a_result_file_can_be_refined_in_place_and_may_be_empty() {
    let world = World::new();
    let rows = world.rows();
    write_results(world.path("in.csv"), &rows).unwrap();
    world.run("--output in.csv").exits(2);
    let words = "bop refine --dataset . --results in.csv --output in.csv";
    world.command(words).exits(0);
    for (before, after) in rows
        .iter()
        .zip(&read_results(world.path("in.csv")).unwrap())
    {
        world.assert_refined(before, after);
    }
    let (run, refined) = world.refine(&[], "");
    assert!(
        run.exits(0)
            .warns(&["in.csv has no rows"])
            .out
            .contains("0 rows")
    );
    assert!(refined.is_empty());
}

#[test]
fn a_dataset_without_any_of_the_frames_is_an_error() {
    let world = World::new();
    let pose = world.rows()[0].camera_from_object();
    let rows = [
        ResultRow::new(3, 5, CAR, pose),
        ResultRow::new(99, 0, CAR, pose),
    ];
    let (run, refined) = world.refine(&rows, "");
    run.fails(&["in.csv", "no image of its rows", "--split"]);
    assert!(rows.iter().zip(&refined).all(|(a, b)| same_pose(a, b)));
}
