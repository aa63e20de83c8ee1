//! `hybrid-icp bop generate`, and the refinement and evaluation of its datasets.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::*;
use hicp_io::bop::{Dataset, read_results};
use serde_json::Value;

const SMALL: &str = "bop generate --scenes 2 --images 2 --instances 5 --seed 11";

#[track_caller]
fn generate(folder: &Folder, options: &str) -> Run {
    let run = folder.command(format!("{SMALL} {options}")).exits(0);
    assert_eq!(run.err, "");
    run
}

/// Evaluates, asserts that there is no warning, and returns the report.
#[track_caller]
fn eval(folder: &Folder, results: &str) -> Value {
    let words = format!("bop eval --dataset set --results {results} --json report.json");
    let run = folder.command(words).exits(0);
    assert_eq!(run.err, "");
    folder.json("report.json")
}

#[test]
fn generated_refined_evaluated() {
    let folder = Folder::new();
    let told = generate(&folder, "--out set --starts 2");
    told.prints(&["4 images of 2 scenes"]);
    let initial = "set/initial_synthetic-test.csv";
    let words = format!("bop refine --dataset set --results {initial} --output out.csv");
    let run = folder.command(words).exits(0);
    // The initial pose of a mostly hidden object may explain nothing.
    let elsewhere = "rows the initial pose explained nothing of the mask";
    assert!(
        run.err.lines().all(|line| line.contains(elsewhere)),
        "{}",
        run.err
    );
    assert!(
        !run.out.contains("no mask") && !run.out.contains("missing"),
        "{}",
        run.out
    );

    let truth = eval(&folder, "set/truth_synthetic-test.csv");
    for recall in ["ar", "ar_vsd", "ar_mssd", "ar_mspd", "ad_recall"] {
        assert_eq!(truth[recall], 1.0, "{recall}");
    }
    assert_eq!(truth["missing"], 0);
    // Of two estimates of an instance, only one is evaluated.
    let rows = read_results(folder.path(initial)).unwrap();
    let alone = read_results(folder.path("set/truth_synthetic-test.csv")).unwrap();
    assert_eq!(rows.len(), 2 * alone.len());
    assert_eq!(truth["targets"].as_u64().unwrap(), alone.len() as u64);
    // With one start each, every instance has one estimate, and no row is beyond the targets.
    let one_each = |name: &str, from: &str| {
        let mut rows = read_results(folder.path(from)).unwrap();
        rows.retain(|row| row.score == 1.0);
        assert_eq!(rows.len(), alone.len());
        hicp_io::bop::write_results(folder.path(name), &rows).unwrap();
        eval(&folder, name)
    };
    let before = one_each("before.csv", initial);
    let after = one_each("after.csv", "out.csv");
    for recall in ["ar", "ar_vsd", "ar_mssd", "ar_mspd"] {
        let (before, after) = (
            before[recall].as_f64().unwrap(),
            after[recall].as_f64().unwrap(),
        );
        assert!(before < after, "{recall}: {before} -> {after}");
    }
    // Both starts of each instance give the recalls of the first ones.
    let words = "bop eval --dataset set --results out.csv --json report.json";
    folder.command(words).warns(&["the last of equal ones"]);
    let both = folder.json("report.json");
    assert_eq!(both["ar"], after["ar"]);
    let adi = |report: &Value| report["median_adi_mm"].as_f64().unwrap();
    assert!(
        adi(&after) < 0.5 * adi(&before),
        "{} -> {}",
        adi(&before),
        adi(&after)
    );
}

#[test]
fn symmetric_equivalents_of_the_truth_score_one() {
    let folder = Folder::new();
    generate(&folder, "--out set");
    let infos = Dataset::open(folder.path("set")).unwrap();
    let infos = infos.read_models_info().unwrap();
    let mut rows = read_results(folder.path("set/truth_synthetic-test.csv")).unwrap();
    let (mut turned, mut flipped) = (0, 0);
    for row in &mut rows {
        let symmetries = &infos[&row.obj_id].symmetries;
        let mut pose = row.camera_from_object();
        if let Some(axis) = symmetries.continuous.first() {
            // The angle is not a multiple of BOP's steps around an axis.
            pose *= axis.rotation(2.345);
            turned += 1;
        }
        if let Some(other) = symmetries.discrete.last() {
            pose *= other;
            flipped += 1;
        }
        row.set_camera_from_object(pose);
    }
    assert!(turned > 0 && flipped > 0, "{turned} {flipped}");
    hicp_io::bop::write_results(folder.path("turned.csv"), &rows).unwrap();
    let report = eval(&folder, "turned.csv");
    assert_eq!(report["ar_mssd"], 1.0);
    assert_eq!(report["ar_mspd"], 1.0);
    assert_eq!(report["ad_recall"], 1.0);
    // Meshes are less round than their symmetries declare, so some pixels of silhouettes may
    // differ.
    assert!(report["ar_vsd"].as_f64().unwrap() >= 0.989);

    // Without declared symmetries, the same poses are wrong.
    folder.change_json("set/models/models_info.json", |declared| {
        for info in declared.as_object_mut().unwrap().values_mut() {
            let info = info.as_object_mut().unwrap();
            info.retain(|key, _| !key.starts_with("symmetries"));
        }
    });
    let report = eval(&folder, "turned.csv");
    assert!(report["ar_mssd"].as_f64().unwrap() < 1.0);
}

#[test]
fn the_layout_is_that_of_the_benchmark() {
    let folder = Folder::new();
    generate(&folder, "--out set");
    let set = folder.path("set");
    assert_eq!(
        folder.names("set"),
        [
            "camera.json",
            "initial_synthetic-test.csv",
            "models",
            "test",
            "test_targets_bop19.json",
            "truth_synthetic-test.csv"
        ]
    );
    let dataset = Dataset::open(&set).unwrap();
    assert_eq!(dataset.scene_ids("test").unwrap(), [1, 2]);
    let infos = dataset.read_models_info().unwrap();
    assert_eq!(infos.len(), 20);
    assert!(infos.values().any(|info| !info.symmetries.is_empty()));
    let mut wanted = BTreeMap::new();
    let mut hidden = 0;
    for scene_id in [1, 2] {
        let scene = dataset.scene("test", scene_id).unwrap();
        let mut in_world = None;
        for im_id in 0..2 {
            let truths = scene.ground_truth(im_id).unwrap();
            let info = scene.ground_truth_info(im_id).unwrap();
            assert_eq!((truths.len(), info.len()), (5, 5));
            let depth = scene.read_depth(im_id).unwrap();
            let world = scene
                .camera(im_id)
                .unwrap()
                .camera_from_world
                .unwrap()
                .inverse();
            // The objects do not move while the camera does.
            let poses: Vec<_> = truths
                .iter()
                .map(|t| world * t.camera_from_object)
                .collect();
            let first = in_world.get_or_insert_with(|| poses.clone());
            for (a, b) in poses.iter().zip(first.iter()) {
                assert!((a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-9);
            }
            for (index, (truth, info)) in truths.iter().zip(info).enumerate() {
                let mask = scene.read_visible_mask(im_id, index).unwrap();
                let seen = mask.n_set();
                assert_eq!(info.visible_pixels.unwrap() as usize, seen);
                // Measured depth in the object's mask is near the object.
                let z = truth.camera_from_object.translation.z;
                let radius = infos[&truth.obj_id].diameter_m;
                for (depth, set) in depth.pixels().iter().zip(mask.pixels()) {
                    let away = (f64::from(*depth) - z).abs();
                    assert!(!set || *depth == 0.0 || away < radius + 0.05, "{depth} {z}");
                }
                let fraction = info.visible_fraction.unwrap();
                hidden += usize::from(fraction < 0.99);
                if fraction >= 0.1 {
                    *wanted.entry((scene_id, im_id, truth.obj_id)).or_insert(0) += 1;
                }
            }
        }
    }
    assert!(hidden > 3, "{hidden}");
    let targets = dataset.read_targets().unwrap();
    let targets = targets
        .iter()
        .map(|t| ((t.scene_id, t.im_id, t.obj_id), t.inst_count));
    assert_eq!(targets.collect::<BTreeMap<_, _>>(), wanted);
}

#[test]
fn the_same_options_give_the_same_bytes_on_any_number_of_threads() {
    let folder = Folder::new();
    generate(&folder, "--out a --threads 1");
    generate(&folder, "--out b --threads 3");
    let files_of_a = folder.files("a");
    // 4 images have a depth image and 2 x 5 masks each. 2 scenes have 3 files each. There are 20
    // models with their info, and 4 other files.
    assert_eq!(files_of_a.len(), 4 * 11 + 6 + 21 + 4);
    assert!(files_of_a == folder.files("b"));
    let other = SMALL.replace("11", "12") + " --out c";
    folder.command(other).exits(0);
    let depth = Path::new("test/000001/depth/000000.png");
    assert_ne!(folder.files("c")[depth], files_of_a[depth]);

    // The models of the dataset give the same scenes: ids, sizes and symmetries come from the
    // files.
    generate(&folder, "--out d --objects a/models");
    let read = |set: &str| {
        Dataset::open(folder.path(set))
            .unwrap()
            .read_models_info()
            .unwrap()
    };
    let (ours, theirs) = (read("a"), read("d"));
    assert_eq!(
        ours.keys().collect::<Vec<_>>(),
        theirs.keys().collect::<Vec<_>>()
    );
    for (id, info) in &ours {
        assert!((info.diameter_m - theirs[id].diameter_m).abs() < 1e-5);
        let count = |info: &hicp_io::bop::ModelInfo| {
            (
                info.symmetries.discrete.len(),
                info.symmetries.continuous.len(),
            )
        };
        assert_eq!(count(info), count(&theirs[id]));
    }
    // Meshes may have any name; these are in meters.
    folder.command("objects --out meshes").exits(0);
    generate(&folder, "--out e --objects meshes");
    assert_eq!(read("e").len(), 20);
    // Ids in the names of all meshes are kept.
    for (name, id) in [("mug", 30), ("pan", 5)] {
        let mesh = folder.bytes(format!("meshes/{name}.ply"));
        folder.create_dir("named");
        folder.write(format!("named/obj_{id:06}.ply"), mesh);
    }
    generate(&folder, "--out f --objects named");
    assert!(read("f").keys().eq(&[5, 30]));
}

#[test]
fn impossible_options_are_refused() {
    let folder = Folder::new();
    let fails = |options: &str, code: i32, parts: &[&str]| {
        let words = format!("bop generate {options}");
        folder.command(words).exits(code).complains(parts);
    };
    folder.create_dir("full");
    folder.write("full/mine.txt", "the user's");
    fails(
        "--scenes 1 --out full",
        1,
        &["--out full has 1 entries", "new or empty folder"],
    );
    assert_eq!(folder.names("full"), ["mine.txt"]);
    fails(
        "--scenes 1 --out new --objects full",
        1,
        &["--objects full: found no mesh", "PLY, OBJ or STL"],
    );
    fails(
        "--scenes 1 --out new --objects gone",
        1,
        &["cannot list --objects gone"],
    );
    hicp_io::write_ply(
        folder.path("full/car.ply"),
        &car(),
        hicp_io::LengthUnit::Millimeters,
    )
    .unwrap();
    fails(
        "--scenes 1 --out new --objects full",
        1,
        &["object 1 has a diameter of", "--objects-unit"],
    );
    folder.write("full/car.ply", "ply\n");
    fails("--scenes 1 --out new --objects full", 1, &["car.ply"]);
    fails("--scenes 0 --out new", 2, &["--scenes", "'0'", "1.."]);
    fails(
        "--scenes 100000 --images 100000 --out new",
        1,
        &["10000000000 images, expected at most 1000000 in all"],
    );
    fails(
        "--scenes 1 --perturbation 1e300 --out new",
        2,
        &["--perturbation", "above 0 and at most 1000"],
    );
    fails(
        "--scenes 1 --images -1 --out new",
        2,
        &["--images", "'-1'", "1.."],
    );
    fails(
        "--scenes 1 --instances 41 --out new",
        2,
        &["--instances", "'41'", "1..=40"],
    );
    fails(
        "--scenes 1 --objects-unit inch --out new",
        2,
        &["--objects-unit", "inch", "m, mm or cm"],
    );
    fails("--out new", 2, &["--scenes"]);
    assert_eq!(folder.names(""), ["full"]);
}
