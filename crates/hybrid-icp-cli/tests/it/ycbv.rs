//! The program on real frames, if the machine has them.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::common::*;
use hicp_bop::ModelFolder;
use hicp_io::bop::{Dataset, read_results};
use hicp_sim::{RelativeGaussian, rng};
use hybrid_icp::core::{DepthImage, Observation};
use hybrid_icp::switch::PAPER_ALPHA;
use hybrid_icp::{Preset, Refiner, Warning};

/// Returns the dataset's folder: `ycbv` in `BOP_PATH`, in `HICP_DATA/bop`, or in the shared data.
///
/// The folder must have the result files of the excerpt that these tests use.
fn root() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/bop");
    let folders = [
        std::env::var_os("BOP_PATH").map(PathBuf::from),
        std::env::var_os("HICP_DATA").map(|data| PathBuf::from(data).join("bop")),
        Some(beside),
    ];
    let found = folders
        .into_iter()
        .flatten()
        .map(|f| f.join("ycbv"))
        .find(|f| f.join("results").is_dir());
    if found.is_none() {
        println!("skipped: no ycbv dataset; set BOP_PATH to the folder that holds it");
    }
    found
}

/// From a rough pose, a bent depth image may be nearer to the model, but it fits no better.
#[test]
fn a_rough_pose_is_no_fault_of_the_depth_image() {
    let Some(root) = root() else { return };
    let folder = Folder::new();
    folder.write(
        "camera.json",
        r#"{"cam_K": [1066.778, 0, 312.9869, 0, 1067.487, 241.3109, 0, 0, 1], "depth_scale": 0.1}"#,
    );
    let pose = r#"{"cam_R_m2c": [0.672873, -0.739703, 0.00905, -0.302544, -0.286333, -0.90911,
        0.675062, 0.608978, -0.416458], "cam_t_m2c": [-98.3928, 125.3708, 829.6257]}"#;
    folder.write("init.json", pose);
    let scene = root.join("test/000050");
    let files = [
        ("--model", root.join("models/obj_000010.ply")),
        ("--depth", scene.join("depth/000001.png")),
        ("--mask", scene.join("mask_visib/000001_000003.png")),
        ("--camera", "camera.json".into()),
        ("--init", "init.json".into()),
    ];
    let mut words: Vec<&OsStr> = ["doctor", "--model-unit", "mm"].map(OsStr::new).to_vec();
    words.extend(
        files
            .iter()
            .flat_map(|(option, path)| [OsStr::new(*option), path.as_os_str()]),
    );
    let told = run(folder.root(), words).exits(0).out;
    assert!(told.starts_with("no fault found"), "{told}");
}

#[test]
fn real_estimates_of_four_methods_are_improved() {
    let Some(root) = root() else { return };
    improves(&root, &[]);
}

/// The paper's method always keeps its result; the default keeps a pose that it does not improve.
#[test]
fn the_papers_method_moves_most_real_estimates() {
    let Some(root) = root() else { return };
    for (moved, of) in improves(&root, &["--pipeline", "hybrid"]) {
        assert!(10 * moved >= 8 * of, "{moved} of {of}");
    }
}

/// Refines the four result files on one and on two threads.
///
/// Returns the number of moved poses and of all poses for each.
fn improves(root: &Path, options: &[&str]) -> Vec<(usize, usize)> {
    let mut all_moved = Vec::new();
    let folder = Folder::new();
    let mut files = 0;
    for entry in std::fs::read_dir(root.join("results")).unwrap() {
        let results = entry.unwrap().path();
        files += 1;
        let mut bytes = Vec::new();
        for threads in ["1", "2"] {
            let mut arguments = vec![
                OsStr::new("bop"),
                OsStr::new("refine"),
                OsStr::new("--no-time"),
                OsStr::new("--dataset"),
                root.as_os_str(),
                OsStr::new("--split"),
                OsStr::new("test"),
                OsStr::new("--results"),
                results.as_os_str(),
                OsStr::new("--output"),
                OsStr::new("out.csv"),
                OsStr::new("--threads"),
                OsStr::new(threads),
            ];
            arguments.extend(options.iter().map(OsStr::new));
            let done = run(folder.root(), arguments).exits(0);
            // Some real estimates give warnings, but the dataset gives none.
            let of_poses = |line: &str| line.starts_with("warning: out.csv: ");
            assert!(done.err.lines().all(of_poses), "{}", done.err);
            let line = done.out.lines().find(|l| l.contains("median MVE")).unwrap();
            let medians: Vec<f64> = line
                .split_whitespace()
                .filter_map(|w| w.parse().ok())
                .collect();
            assert!(medians.len() == 2 && medians[1] < medians[0], "{line}");
            bytes.push(folder.bytes("out.csv"));
        }
        assert_eq!(bytes[0], bytes[1]);
        let (before, after) = (
            read_results(&results).unwrap(),
            read_results(folder.path("out.csv")).unwrap(),
        );
        assert_eq!(before.len(), after.len());
        let mut moved = 0;
        for (before, after) in before.iter().zip(&after) {
            let key = |row: &hicp_io::bop::ResultRow| (row.scene_id, row.im_id, row.obj_id);
            assert_eq!(key(before), key(after));
            moved += usize::from(before.translation_mm() != after.translation_mm());
        }
        all_moved.push((moved, before.len()));
    }
    assert_eq!(files, 4);
    all_moved
}

/// The content of the mask that a row is refined in.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Inside {
    /// The object of the row.
    Own,
    /// The first other object of the image.
    Other,
    /// A wall in the mask of the object, nearer than its center by a fifth of the diameter.
    Wall,
}

/// Refines the rows of a result file and returns four counts.
///
/// They are the rows with a good MVE, those with a confidence of 0.95 or more, those with the
/// warning `Flat`, those with any warning, and all rows.
fn found_in(root: &Path, results: &Path, inside: Inside) -> [usize; 5] {
    let dataset = Dataset::open(root).unwrap();
    let folder = ModelFolder::open(dataset.models_dir().unwrap()).unwrap();
    let mut refiner = Refiner::preset(Preset::Auto);
    let mut counts = [0; 5];
    for row in read_results(results).unwrap() {
        let model = folder.read(row.obj_id).unwrap().unwrap();
        let scene = dataset.scene("test", row.scene_id).unwrap();
        let truths = scene.ground_truth(row.im_id).unwrap();
        let instance = truths
            .iter()
            .position(|truth| (truth.obj_id == row.obj_id) != (inside == Inside::Other))
            .unwrap();
        let mut depth = scene.read_depth(row.im_id).unwrap();
        let camera = scene.camera(row.im_id).unwrap();
        let camera = camera.pinhole(depth.width(), depth.height()).unwrap();
        let mask = scene.read_visible_mask(row.im_id, instance).unwrap();
        if inside == Inside::Wall {
            let center = truths[instance].camera_from_object * model.center();
            let z = center.z - 0.2 * model.diameter();
            let wall = DepthImage::from_meters(
                depth.width(),
                depth.height(),
                vec![z as f32; depth.pixels().len()],
            );
            // Add 0.3 % of noise.
            depth = RelativeGaussian { percent: 0.3 }.apply(&mut rng(3), &wall.unwrap());
        }
        let observation = Observation::new(depth, mask, camera).unwrap();
        let refined = refiner.refine(&model, &observation, &row.camera_from_object());
        let warnings = refined.warnings();
        let count = |what: fn(&Warning) -> bool| usize::from(warnings.iter().any(what));
        counts[0] += usize::from(refined.mve < PAPER_ALPHA);
        counts[1] += usize::from(refined.confidence >= 0.95);
        counts[2] += count(|warning| matches!(warning, Warning::Flat { .. }));
        counts[3] += usize::from(!warnings.is_empty());
        counts[4] += 1;
    }
    counts
}

/// Results in the mask of something else have a low confidence.
///
/// Nineteen of twenty on a wall also have a warning, some of them that it may be a wall: a flat
/// face of a model fits a wall as well as its own place. On the correct object, none has that
/// warning.
#[test]
fn results_in_the_mask_of_something_else_have_a_low_confidence() {
    let Some(root) = root() else { return };
    let (mut own, mut wall) = ([0; 5], [0; 5]);
    for entry in std::fs::read_dir(root.join("results")).unwrap() {
        let file = entry.unwrap().path();
        for (sum, inside) in [(&mut own, Inside::Own), (&mut wall, Inside::Wall)] {
            for (sum, count) in sum.iter_mut().zip(found_in(&root, &file, inside)) {
                *sum += count;
            }
        }
    }
    let file = root.join("results/cosypose_ycbv-test.csv");
    let other = found_in(&root, &file, Inside::Other);
    println!(
        "good, confident, flat, warned of, all: on the correct object {own:?}, \
         another {other:?}, a wall {wall:?}"
    );
    assert!(own[2] == 0 && 10 * own[0] >= 9 * own[4], "{own:?}");
    assert!(other[0] > 0 && other[1] == 0, "{other:?}");
    assert!(
        wall[0] > 0 && wall[1] == 0 && wall[2] > 0 && 20 * wall[3] >= 19 * wall[4],
        "{wall:?}"
    );
}

#[test]
fn one_real_instance_is_refined_from_its_files() {
    let Some(root) = root() else { return };
    let folder = Folder::new();
    let dataset = Dataset::open(&root).unwrap();
    let scene = dataset.scene("test", 51).unwrap();
    let truth = scene.ground_truth(1).unwrap()[1];
    let rows = read_results(root.join("results/sundermeyer_ycbv-test.csv")).unwrap();
    let row = rows
        .iter()
        .find(|row| (row.scene_id, row.im_id, row.obj_id) == (51, 1, truth.obj_id))
        .unwrap();
    let init = folder.path("init.json");
    hicp_io::write_pose_json(&init, &row.camera_from_object()).unwrap();
    // A `scene_camera.json` with one image is a valid camera file.
    let (model, depth) = (
        dataset.model_path(truth.obj_id).unwrap(),
        scene.depth_path(1).unwrap(),
    );
    let (mask, camera) = (
        scene.visible_mask_path(1, 1),
        scene.dir().join("scene_camera.json"),
    );
    let arguments = [
        OsStr::new("refine"),
        OsStr::new("--model"),
        model.as_os_str(),
        OsStr::new("--model-unit"),
        OsStr::new("mm"),
        OsStr::new("--depth"),
        depth.as_os_str(),
        OsStr::new("--mask"),
        mask.as_os_str(),
        OsStr::new("--camera"),
        camera.as_os_str(),
        OsStr::new("--init"),
        init.as_os_str(),
        OsStr::new("--overlay"),
        OsStr::new("overlay.png"),
    ];
    let done = run(folder.root(), arguments).exits(0);
    // Depth does not tell the two sides of the box apart.
    let (_, warning) = done.err.split_once("warning: ambiguous: 2 poses").unwrap();
    let apart = warning.split_once("° apart").map(|(text, _)| text);
    let degrees: Option<f64> = apart.and_then(|text| text.rsplit_once(' ')?.1.parse().ok());
    assert!(degrees.is_some_and(|turn| turn > 170.0), "{warning}");
    let result: serde_json::Value = serde_json::from_str(&done.out).unwrap();
    assert!(result["mve"].as_f64().unwrap() < 0.5 * result["mve_initial"].as_f64().unwrap());
    let error = |pose: &hybrid_icp::core::Isometry3<f64>| {
        (pose.translation.vector - truth.camera_from_object.translation.vector).norm()
    };
    assert!(error(&crate::common::pose_of(&result)) < 0.5 * error(&row.camera_from_object()));
    assert!(folder.path("overlay.png").is_file());
}
