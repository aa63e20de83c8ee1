//! `hybrid-icp align`.

use hybrid_icp::core::{Isometry3, Vector3, se3};
use serde_json::{Value, json};

use crate::common::*;

#[test]
fn two_clouds_are_registered_and_the_result_is_an_initial_pose() {
    let folder = Folder::new();
    let motion = Isometry3::new(
        Vector3::new(0.3, 0.004, -0.003),
        Vector3::new(0.05, 0.03, 0.7),
    );
    write_clouds(&folder, &motion);
    let rough = motion
        * Isometry3::new(
            Vector3::new(0.002, 0.0, 0.001),
            Vector3::new(0.0, 0.04, 0.0),
        );
    folder.write("pose.json", pose_json(&rough).to_string());
    for method in ["point-to-point", "point-to-plane", "gicp"] {
        let words =
            format!("align a.ply b.pcd --init pose.json --output found.json --method {method}");
        let run_ = folder.command(words).exits(0);
        assert!(run_.out.starts_with("refined: fitness "), "{}", run_.out);
        assert_contains(
            &run_.err,
            &["target: no normals: estimated from 20 neighbors"],
        );
        let found = folder.json("found.json");
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
        let again = folder.command("align a.ply b.pcd --init found.json --voxel 0.002");
        let again = again.exits(0).json();
        assert!(again["source_points"].as_u64().unwrap() < 3000);
    }
}

#[test]
fn points_that_are_not_finite_are_counted() {
    let folder = Folder::new();
    write_clouds(&folder, &Isometry3::identity());
    let cloud = "0 0 0\n0.1 0 0\nnan 0 0\n0 0.1 0\n0 0 0.1\n0.1 0.1 0.1\n";
    folder.write("c.xyz", cloud);
    let run_ = folder.command("align c.xyz b.pcd").exits(0);
    assert_contains(
        &run_.err,
        &["c.xyz: 1 of 6 points were skipped: they are not finite"],
    );
    assert_contains(&run_.json()["warnings"][0].to_string(), &["c.xyz: 1 of 6"]);
}

#[test]
fn points_at_zero_are_skipped_in_both_clouds() {
    let folder = Folder::new();
    write_clouds(&folder, &Isometry3::identity());
    let found = folder.command("align b.pcd a.ply").exits(0).json();
    let cloud = hicp_io::read_cloud(folder.path("b.pcd"), hicp_io::LengthUnit::Meters).unwrap();
    let rows = cloud
        .points
        .iter()
        .map(|p| format!("{} {} {}\n", p.x, p.y, p.z));
    folder.write(
        "zeros.xyz",
        "0 0 0\n".repeat(500) + &rows.collect::<String>(),
    );
    for (clouds, side) in [("zeros.xyz a.ply", "source"), ("a.ply zeros.xyz", "target")] {
        let run_ = folder.command(format!("align {clouds}")).exits(0);
        let warning = format!("{side}: 500 points were skipped: they are not finite, at (0, 0, 0)");
        assert_contains(&run_.err, &[&warning]);
        if side == "source" {
            assert_eq!(run_.json()["fitness"], found["fitness"]);
        }
    }
}

#[test]
fn lengths_in_another_unit_are_warned_of() {
    let folder = Folder::new();
    write_clouds(&folder, &Isometry3::identity());
    let warned = |words: &str| {
        let run_ = folder
            .command(format!("align a.ply b.pcd {words}"))
            .exits(0);
        assert!(!run_.err.contains("check --init"), "{}", run_.err);
        run_
    };
    warned("--max-distance 5")
        .complains(&["--max-distance is 5.0000 m, more than the extent of the target"]);
    warned("--voxel 2").complains(&[
        "--voxel is 2.0000 m, more than the extent of the source",
        "--voxel is 2.0000 m, more than the extent of the target",
    ]);
    let run_ = warned("--max-distance 0.01 --voxel 0.002");
    assert!(!run_.err.contains("more than the extent"), "{}", run_.err);
}

#[test]
fn clouds_that_do_not_overlap_are_warned_of() {
    let folder = Folder::new();
    write_clouds(&folder, &Isometry3::translation(5.0, 0.0, 0.0));
    let run_ = folder.command("align a.ply b.pcd").exits(0);
    let found = run_.json();
    assert_eq!(
        (&found["outcome"], &found["rmse_m"]),
        (&json!("kept_initial"), &Value::Null)
    );
    assert_eq!(found["termination"], "no_pairs");
    assert_contains(&run_.err, &["do not trust the pose: check --init"]);
    let run_ = folder
        .command("align a.ply b.pcd --target-unit mm")
        .exits(0);
    run_.complains(&["a ratio of 1000", "check --unit m and --target-unit mm"]);
}

#[test]
fn wrong_arguments_are_refused() {
    let folder = Folder::new();
    write_clouds(&folder, &Isometry3::identity());
    let refused = |words: &str, part: &str| {
        let run_ = folder.command(format!("align a.ply {words}"));
        assert!(run_.code != 0 && run_.err.contains(part), "{}", run_.err);
    };
    refused("b.pcd --method gipc", "did you mean \"gicp\"?");
    refused("none.ply", "none.ply");
    refused("b.pcd --neighbors 2", "2 is not in 3..");
    refused("b.pcd --output b.pcd", "--output and TARGET both name");
    refused("b.pcd --voxel 0", "expected a finite number above 0");
}
