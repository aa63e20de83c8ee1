//! `hybrid-icp bop refine` on datasets in the wrong unit: it refines what it can, and says once per object what looks wrong.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod common;
#[path = "common/world.rs"]
mod world;

use common::*;
use hicp_io::LengthUnit;
use hicp_io::bop::write_results;
use hybrid_icp::{Isometry3, Point3, TriMesh};
use world::*;

/// Lines of warnings.
fn warnings(run: &Run) -> Vec<&str> {
    run.err
        .lines()
        .filter(|l| l.starts_with("warning: "))
        .collect()
}

/// Changes what the cameras of all scenes state.
fn in_cameras(world: &World, from: &str, to: &str) {
    for scene in [3, 12] {
        let path = world.scene(scene).join("scene_camera.json");
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{text}");
        std::fs::write(path, text.replace(from, to)).unwrap();
    }
}

#[test]
fn nothing_is_said_of_a_dataset_that_is_right() {
    let world = World::new();
    let (run, _) = world.refine(&world.rows(), &[]);
    assert_eq!(run.exits(0).err, "");
}

#[test]
fn depth_at_ten_times_its_scale_is_told_once_per_object() {
    let world = World::new();
    in_cameras(&world, "\"depth_scale\":0.1", "\"depth_scale\":1.0");
    let (run, _) = world.refine(&world.rows(), &[]);
    let run = run.exits(0);
    let told = warnings(&run);
    assert_eq!(told.len(), 2, "{}", run.err);
    for (line, (object, images)) in told.iter().zip([(CAR, 4), (HAMMER, 2)]) {
        let begin = format!("warning: object {object}: the median depth inside the mask is ");
        assert!(line.starts_with(&begin), "{line}");
        let end = format!(
            " ({images} of {images} images): check depth_scale in scene_camera.json, and that --results states millimetres"
        );
        assert!(line.ends_with(&end), "{line}");
    }
}

#[test]
fn depth_that_counts_as_missing_is_told_once_per_object() {
    let world = World::new();
    in_cameras(&world, "\"depth_scale\":0.1", "\"depth_scale\":1e9");
    let (run, rows) = world.refine(&world.rows(), &[]);
    let run = run.exits(0);
    let told = warnings(&run);
    assert_eq!(told.len(), 2, "{}", run.err);
    assert!(
        told.iter()
            .all(|line| line.contains("no depth inside the mask"))
    );
    assert!(rows.iter().zip(world.rows()).all(|(a, b)| same_pose(a, &b)));
}

#[test]
fn a_model_in_metres_is_told_before_a_pose_depends_on_it() {
    let world = World::new();
    let path = world.path("models/obj_000001.ply");
    hicp_io::write_ply(&path, &car(), LengthUnit::Meters).unwrap();
    let (run, _) = world.refine(&world.rows(), &[]);
    let run = run.exits(0);
    let told: Vec<_> = warnings(&run);
    let about_model = told
        .iter()
        .filter(|line| line.contains("the model's diameter is"));
    assert_eq!(about_model.count(), 1, "{}", run.err);
    assert!(
        told[0].starts_with("warning: object 1: the model's diameter is "),
        "{}",
        run.err
    );
    assert!(told[0].contains("models is in mm"), "{}", run.err);
    assert!(
        told.iter().all(|line| !line.contains("object 2")),
        "{}",
        run.err
    );
}

#[test]
fn a_model_of_a_tenth_of_its_size_is_told_by_the_masks() {
    let world = World::new();
    let small = car();
    let vertices = small
        .vertices()
        .iter()
        .map(|p| Point3::from(p.coords * 0.1));
    let small = TriMesh::new(vertices.collect(), small.triangles().to_vec()).unwrap();
    let path = world.path("models/obj_000001.ply");
    hicp_io::write_ply(&path, &small, LengthUnit::Millimeters).unwrap();
    let (run, _) = world.refine(&world.rows(), &[]);
    let run = run.exits(0);
    let told = warnings(&run);
    assert_eq!(told.len(), 1, "{}", run.err);
    assert!(
        told[0].starts_with("warning: object 1: the mask has "),
        "{}",
        run.err
    );
    assert!(
        told[0].contains("check that models are in mm"),
        "{}",
        run.err
    );
}

#[test]
fn poses_that_are_far_off_in_a_few_images_are_no_matter_of_units() {
    let world = World::new();
    let mut rows = world.rows();
    // One image of four: its cars four times as far, on the same line of sight.
    for row in rows
        .iter_mut()
        .filter(|row| (row.scene_id, row.im_id) == (3, 0))
    {
        let mut pose: Isometry3<f64> = row.camera_from_object();
        pose.translation.vector *= 4.0;
        row.set_camera_from_object(pose);
    }
    write_results(world.path("in.csv"), &rows).unwrap();
    let run = world.run(&[]).exits(0);
    assert!(!run.err.contains("median depth"), "{}", run.err);
}
