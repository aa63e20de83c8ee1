//! The program on real frames, where the machine has them.
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests")]

mod common;

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use common::run;
use hicp_io::bop::{Dataset, read_results};

/// The dataset's folder: `ycbv` in `BOP_PATH`, in `HICP_DATA/bop`, or in the shared data beside the project.
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
        .find(|f| f.is_dir());
    if found.is_none() {
        println!("skipped: no ycbv dataset; set BOP_PATH to the folder that holds it");
    }
    found
}

#[test]
fn real_estimates_of_four_methods_are_improved() {
    let Some(root) = root() else { return };
    improves(&root, &[]);
}

/// The paper's method keeps its result whatever the score says; the default keeps a pose that it does not make better.
#[test]
fn the_papers_method_moves_most_real_estimates() {
    let Some(root) = root() else { return };
    for (moved, of) in improves(&root, &["--pipeline", "hybrid"]) {
        assert!(10 * moved >= 8 * of, "{moved} of {of}");
    }
}

/// Refines the four result files, on one and on two threads; returns how many poses were moved, and of how many.
fn improves(root: &Path, options: &[&str]) -> Vec<(usize, usize)> {
    let mut all_moved = Vec::new();
    let folder = tempfile::tempdir().unwrap();
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
            let done = run(folder.path(), arguments).exits(0);
            assert_eq!(done.err, "");
            let line = done.out.lines().find(|l| l.contains("median MVE")).unwrap();
            let medians: Vec<f64> = line
                .split_whitespace()
                .filter_map(|w| w.parse().ok())
                .collect();
            assert!(medians.len() == 2 && medians[1] < medians[0], "{line}");
            bytes.push(std::fs::read(folder.path().join("out.csv")).unwrap());
        }
        assert_eq!(bytes[0], bytes[1]);
        let (before, after) = (
            read_results(&results).unwrap(),
            read_results(folder.path().join("out.csv")).unwrap(),
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

#[test]
fn one_real_instance_is_refined_by_its_files() {
    let Some(root) = root() else { return };
    let folder = tempfile::tempdir().unwrap();
    let dataset = Dataset::open(&root).unwrap();
    let scene = dataset.scene("test", 51).unwrap();
    let truth = scene.ground_truth(1).unwrap()[1];
    let rows = read_results(root.join("results/sundermeyer_ycbv-test.csv")).unwrap();
    let row = rows
        .iter()
        .find(|row| (row.scene_id, row.im_id, row.obj_id) == (51, 1, truth.obj_id))
        .unwrap();
    let init = folder.path().join("init.json");
    hicp_io::write_pose_json(&init, &row.camera_from_object()).unwrap();
    // A scene_camera.json of one image is a camera file.
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
    let done = run(folder.path(), arguments).exits(0);
    assert_eq!(done.err, "");
    let result: serde_json::Value = serde_json::from_str(&done.out).unwrap();
    assert!(result["mve"].as_f64().unwrap() < 0.5 * result["mve_initial"].as_f64().unwrap());
    let error = |pose: &hybrid_icp::Isometry3<f64>| {
        (pose.translation.vector - truth.camera_from_object.translation.vector).norm()
    };
    assert!(error(&common::pose_of(&result)) < 0.5 * error(&row.camera_from_object()));
    assert!(folder.path().join("overlay.png").is_file());
}
