//! `hybrid-icp align`.

use hybrid_icp::core::{Isometry3, Vector3, se3};
use serde_json::{Value, json};

use crate::common::*;

#[test]
fn two_clouds_are_registered_and_the_result_is_an_initial_pose() {
    let folder = tempfile::tempdir().unwrap();
    let motion = Isometry3::new(
        Vector3::new(0.3, 0.004, -0.003),
        Vector3::new(0.05, 0.03, 0.7),
    );
    write_clouds(folder.path(), &motion);
    let rough = motion
        * Isometry3::new(
            Vector3::new(0.002, 0.0, 0.001),
            Vector3::new(0.0, 0.04, 0.0),
        );
    std::fs::write(
        folder.path().join("pose.json"),
        pose_json(&rough).to_string(),
    )
    .unwrap();
    for method in ["point-to-point", "point-to-plane", "gicp"] {
        let words = [
            "align",
            "a.ply",
            "b.pcd",
            "--init",
            "pose.json",
            "--output",
            "found.json",
            "--method",
            method,
        ];
        let run_ = run(folder.path(), words).exits(0);
        assert!(run_.out.starts_with("refined: fitness "), "{}", run_.out);
        assert!(
            run_.err
                .contains("target: no normals: estimated from 20 neighbors"),
            "{}",
            run_.err
        );
        let text = std::fs::read_to_string(folder.path().join("found.json")).unwrap();
        let found: Value = serde_json::from_str(&text).unwrap();
        let (angle, distance) = se3::pose_distance(&pose_of(&found), &motion);
        assert!(
            angle.to_degrees() < 0.5 && distance < 1e-3,
            "{method}: {angle} {distance}"
        );
        assert_eq!(
            (&found["outcome"], &found["termination"]),
            (&json!("refined"), &json!("converged"))
        );
        assert!(found["fitness"].as_f64().unwrap() > 0.95);
        assert_eq!(found["covariance"].as_array().unwrap().len(), 6);
        let again = [
            "align",
            "a.ply",
            "b.pcd",
            "--init",
            "found.json",
            "--voxel",
            "0.002",
        ];
        let again: Value = serde_json::from_str(&run(folder.path(), again).exits(0).out).unwrap();
        assert!(again["source_points"].as_u64().unwrap() < 3000);
    }
}

#[test]
fn clouds_that_do_not_overlap_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    write_clouds(folder.path(), &Isometry3::translation(5.0, 0.0, 0.0));
    let run_ = run(folder.path(), ["align", "a.ply", "b.pcd"]).exits(0);
    let found: Value = serde_json::from_str(&run_.out).unwrap();
    assert_eq!(
        (&found["outcome"], &found["rmse_m"]),
        (&json!("kept_initial"), &Value::Null)
    );
    assert_eq!(found["termination"], "no_pairs");
    assert!(run_.err.contains("do not trust the pose"), "{}", run_.err);
}

#[test]
fn wrong_arguments_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_clouds(folder.path(), &Isometry3::identity());
    let refused = |words: &[&str], part: &str| {
        let run_ = run(folder.path(), [&["align", "a.ply"], words].concat());
        assert!(run_.code != 0 && run_.err.contains(part), "{}", run_.err);
    };
    refused(&["b.pcd", "--method", "gipc"], "did you mean \"gicp\"?");
    refused(&["none.ply"], "none.ply");
    refused(&["b.pcd", "--neighbors", "2"], "2 is not in 3..");
    refused(
        &["b.pcd", "--output", "b.pcd"],
        "--output and TARGET both name",
    );
    refused(
        &["b.pcd", "--voxel", "0"],
        "expected a finite number above 0",
    );
}
