//! Warnings of `hybrid-icp bop refine` about datasets in the wrong unit and about doubtful poses.
//!
//! The program refines all rows that it can, and reports each flaw once per object.

use crate::common::*;
use hicp_io::LengthUnit;
use hicp_io::bop::{read_results, write_results};
use hybrid_icp::core::{DepthImage, Isometry3, Point3, TriMesh};

/// The depth scale in the camera files.
const SCALE: &str = "\"depth_scale\":0.1";

/// Returns the lines with warnings.
fn warnings(run: &Run) -> Vec<&str> {
    run.err
        .lines()
        .filter(|l| l.starts_with("warning: "))
        .collect()
}

/// Returns the warnings that are not about the poses in the output.
fn about_inputs(run: &Run) -> Vec<&str> {
    let of_output = |line: &&str| line.starts_with("warning: out.csv: ");
    warnings(run)
        .into_iter()
        .filter(|line| !of_output(line))
        .collect()
}

/// Returns the fields of the lines that `--rows rows.csv` wrote.
fn lines_of(world: &World) -> Vec<Vec<String>> {
    let mut lines = csv::Reader::from_path(world.path("rows.csv")).unwrap();
    let header = "scene_id,im_id,obj_id,row,status,mve_initial,mve,confidence,warnings";
    assert!(lines.headers().unwrap().iter().eq(header.split(',')));
    let records = lines.records().map(Result::unwrap);
    records
        .map(|line| line.iter().map(str::to_owned).collect())
        .collect()
}

/// Replaces the depth scale in the camera files of some scenes.
fn scale(world: &World, scenes: &[u32], scale: &str) {
    for &scene in scenes {
        let path = world.scene(scene).join("scene_camera.json");
        world.replace(path, SCALE, &format!("\"depth_scale\":{scale}"));
    }
}

#[test]
fn a_correct_dataset_gives_no_warning() {
    let world = World::new();
    let (run, _) = world.refine(&world.rows(), "");
    assert_eq!(run.exits(0).err, "");
}

/// Without declared symmetries, equivalent poses count as wrong.
#[test]
fn objects_that_models_info_does_not_describe_are_named_once() {
    let world = World::new();
    for (content, fault) in [
        (
            Some(r#"{"1": {"diameter": 197.3}}"#),
            "does not describe object 2",
        ),
        (None, "is missing"),
    ] {
        world.remove("models/models_info.json");
        if let Some(content) = content {
            world.write("models/models_info.json", content);
        }
        let (run, _) = world.refine(&world.rows(), "");
        let eval = world.command("bop eval --dataset . --results out.csv");
        let [refine, eval] = [run, eval].map(|run| run.exits(0).err);
        let wanted = format!(
            "warning: ./models/models_info.json {fault}: no symmetries are declared, and diameters are those of the meshes\n"
        );
        assert_eq!(refine, wanted);
        // The first warnings of the evaluation are about absent targets and visibilities.
        assert!(
            eval.ends_with(&wanted) && eval.lines().count() == 3,
            "{eval}"
        );
    }
}

/// Every scene has its own files, so one wrong scene of many must be reported.
#[test]
fn depth_at_ten_times_its_scale_is_reported_once_per_object() {
    for (scenes, named, images) in [
        (&[3, 12][..], "scenes 3, 12", [4, 2]),
        (&[3], "scene 3", [2, 1]),
    ] {
        let world = World::new();
        scale(&world, scenes, "1.0");
        let (run, _) = world.refine(&world.rows(), "");
        let run = run.exits(0);
        let told = about_inputs(&run);
        assert_eq!(told.len(), 2, "{}", run.err);
        for (line, (object, images)) in told.iter().zip([CAR, HAMMER].into_iter().zip(images)) {
            let begin = format!("warning: object {object}: the median depth inside the mask is ");
            assert!(line.starts_with(&begin), "{line}");
            let end = format!(
                " ({images} of {images} images of {named}): check depth_scale in scene_camera.json, and that --results is in mm"
            );
            assert!(line.ends_with(&end), "{line}");
        }
    }
}

/// A factor of two is within the error of a rough pose, so only the scores reveal it.
#[test]
fn poses_that_do_not_explain_their_image_are_counted_and_reported_once() {
    let world = World::new();
    scale(&world, &[3, 12], "0.2");
    let rows = world.rows();
    write_results(world.path("in.csv"), &rows).unwrap();
    let ranked = world.run("--rescore mve").exits(0);
    let scored = read_results(world.path("out.csv")).unwrap();
    let bad = scored.iter().filter(|row| row.score <= 0.6).count();
    assert!(bad > rows.len() / 2, "{bad}");
    let counted = format!(
        "{bad:>7}  with an MVE of 0.4 or more and a confidence below 0.95: do not trust them"
    );
    ranked.prints(&[&counted]);
    let told = format!(
        "warning: out.csv: {bad} of {} rows have an MVE of 0.4 or more after refinement and a confidence below 0.95: do not trust them",
        rows.len()
    );
    let about_scores = |run: &Run| -> Vec<String> {
        let lines = warnings(run)
            .into_iter()
            .filter(|line| line.contains("MVE of"));
        lines.map(str::to_owned).collect()
    };
    assert_eq!(
        about_scores(&ranked),
        [format!("{told} (--rows lists them)")]
    );
    let kept = world.run("--rows rows.csv").exits(0);
    assert_eq!(
        about_scores(&kept),
        [format!("{told} (rows.csv lists them)")]
    );
    // There is one line per row of the output, in its order, with the final numbers.
    let lines = lines_of(&world);
    assert_eq!(lines.len(), rows.len());
    for ((number, row), line) in (0..).zip(&scored).zip(&lines) {
        let ids = [row.scene_id, row.im_id, row.obj_id, number].map(|id| id.to_string());
        assert_eq!(line[..4], ids);
        let mve: f64 = line[6].parse().unwrap();
        assert_eq!(1.0 - mve, row.score);
        let confidence: f64 = line[7].parse().unwrap();
        assert_eq!(
            line[8].contains("the pose does not explain the image"),
            mve >= 0.4 && confidence < 0.95,
            "{line:?}"
        );
    }
}

#[test]
fn results_from_an_initial_pose_that_explained_nothing_are_warned_of() {
    let world = World::new();
    let mut rows = world.rows();
    // The pose shows the car in its mask, but 15 cm behind the measured depth. No pixel agrees, and
    // the search finds the car.
    let row = rows.iter_mut().find(|row| row.obj_id == CAR).unwrap();
    let mut pose = row.camera_from_object();
    pose.translation.vector *= 1.3;
    row.set_camera_from_object(pose);
    let (run, _) = world.refine(&rows, "--rows rows.csv");
    let told = warnings(&run.exits(0)).join("\n");
    let mut counted = 0;
    for line in lines_of(&world) {
        let [before, confidence] = [5, 7].map(|column| line[column].parse::<f64>().unwrap());
        // A result with a high confidence needs no warning.
        let expected = before >= 0.9 && confidence < 0.95;
        let begin = "the initial pose explained nothing of the mask (MVE ";
        assert_eq!(line[8].contains(begin), expected, "{line:?}");
        assert_eq!(line[4], "refined");
        counted += usize::from(expected);
    }
    let text = format!("in {counted} of 10 rows the initial pose explained nothing of the mask");
    assert_eq!(told.contains(&text), counted > 0, "{told}");
}

#[test]
fn results_on_a_wall_are_warned_of() {
    let world = World::new();
    // The masks show cars and a hammer, but the camera measures the wall behind them.
    let (width, height) = (camera().width(), camera().height());
    let wall = vec![0.5; (width * height) as usize];
    let wall = DepthImage::from_meters(width, height, wall).unwrap();
    hicp_io::write_depth_png(world.depth_path(3, 40), &wall, 0.1).unwrap();
    world.refined(&world.rows(), "--rows rows.csv");
    let mut warned = 0;
    for line in lines_of(&world) {
        let on_wall = line[0] == "3" && line[1] == "40";
        let confidence: f64 = line[7].parse().unwrap();
        if on_wall {
            // A pose on a wall is never accepted, and most are warned of.
            assert!(confidence < 0.95, "{line:?}");
            warned += usize::from(!line[8].is_empty());
        } else {
            assert!(confidence >= 0.5 && line[8].is_empty(), "{line:?}");
        }
    }
    assert!(warned > 0);
}

#[test]
fn a_stated_diameter_that_differs_from_the_mesh_is_reported_once() {
    let world = World::new();
    let told = |factor: f64| -> Vec<String> {
        world.state_diameters(factor);
        let (run, _) = world.refine(&world.rows(), "");
        let run = run.exits(0);
        about_inputs(&run).iter().map(|l| (*l).to_owned()).collect()
    };
    for near in [1.0, 0.96, 1.04] {
        assert_eq!(told(near), [""; 0]);
    }
    // A stated diameter of more than a hundred meters is not caused by the unit of the mesh.
    for far in [1.0 / 3.0, 1.06, 10.0, 1000.0] {
        let lines = told(far);
        assert_eq!(lines.len(), 1, "{lines:?}");
        let begin = "models_info.json: object 1: the stated diameter is ";
        assert!(lines[0].contains(begin), "{lines:?}");
        assert!(
            lines[0].contains(" m, but that of the mesh is 0.1"),
            "{lines:?}"
        );
    }
}

#[test]
fn depth_that_counts_as_missing_is_reported_once_per_object() {
    let world = World::new();
    scale(&world, &[3, 12], "1e9");
    let (run, rows) = world.refine(&world.rows(), "");
    let run = run.exits(0);
    let told = about_inputs(&run);
    assert_eq!(told.len(), 2, "{}", run.err);
    assert!(
        told.iter()
            .all(|line| line.contains("no depth inside the mask"))
    );
    assert!(rows.iter().zip(world.rows()).all(|(a, b)| same_pose(a, &b)));
}

#[test]
fn a_model_in_meters_is_reported_before_a_pose_depends_on_it() {
    let world = World::new();
    let path = world.path("models/obj_000001.ply");
    hicp_io::write_ply(&path, &car(), LengthUnit::Meters).unwrap();
    world.state_diameters(1.0);
    let (run, _) = world.refine(&world.rows(), "");
    let run = run.exits(0);
    let told = about_inputs(&run);
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
fn a_model_of_a_tenth_of_its_size_is_detected_by_the_masks() {
    let world = World::new();
    let small = car();
    let vertices = small
        .vertices()
        .iter()
        .map(|p| Point3::from(p.coords * 0.1));
    let small = TriMesh::new(vertices.collect(), small.triangles().to_vec()).unwrap();
    let path = world.path("models/obj_000001.ply");
    hicp_io::write_ply(&path, &small, LengthUnit::Millimeters).unwrap();
    world.state_diameters(1.0);
    let (run, _) = world.refine(&world.rows(), "");
    let run = run.exits(0);
    let told = about_inputs(&run);
    assert_eq!(told.len(), 1, "{}", run.err);
    assert!(
        told[0].starts_with("warning: object 1: the mask has "),
        "{}",
        run.err
    );
    assert!(
        told[0].contains("check that models are in mm, and that --results is in mm"),
        "{}",
        run.err
    );
}

#[test]
fn poses_that_are_far_off_in_a_few_images_are_not_attributed_to_units() {
    let world = World::new();
    let mut rows = world.rows();
    // In one image of four, the cars are four times as far away, on the same line of sight.
    for row in rows
        .iter_mut()
        .filter(|row| (row.scene_id, row.im_id) == (3, 0))
    {
        let mut pose: Isometry3<f64> = row.camera_from_object();
        pose.translation.vector *= 4.0;
        row.set_camera_from_object(pose);
    }
    write_results(world.path("in.csv"), &rows).unwrap();
    let run = world.run("").exits(0);
    assert!(!run.err.contains("median depth"), "{}", run.err);
}
