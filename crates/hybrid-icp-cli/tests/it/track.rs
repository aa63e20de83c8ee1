//! `hybrid-icp track` on folders of depth images.

use crate::common::*;
use hicp_io::bop::read_results;

const TRACK: &str = "track --model set/models/obj_000001.ply --model-unit mm --depth depth \
                     --camera camera.json --init init.json --output out.jsonl";

/// Creates a scene with a moving object, and its images in `depth`, with numbers of any length.
fn recording(images: u32) -> Folder {
    let folder = Folder::new();
    let words = format!(
        "bop generate --scenes 1 --images {images} --instances 3 --seed 6 --moving --out set"
    );
    folder.command(words).exits(0);
    folder.create_dir("depth");
    let scene = "set/test/000001";
    for image in 0..images {
        let depth = folder.bytes(format!("{scene}/depth/{image:06}.png"));
        folder.write(format!("depth/frame-{image}.depth.png"), depth);
    }
    folder.write("depth/notes.txt", "no image");
    let camera = &folder.json(format!("{scene}/scene_camera.json"))["0"];
    folder.write("camera.json", camera.to_string());
    let rows = read_results(folder.path("set/initial_synthetic-test.csv")).unwrap();
    let init = rows.iter().find(|row| (row.im_id, row.obj_id) == (0, 1));
    let init = pose_json(&init.unwrap().camera_from_object());
    folder.write("init.json", init.to_string());
    folder
}

#[test]
fn images_of_a_folder_are_tracked_as_those_of_a_dataset() {
    let folder = recording(12);
    let told = folder.command(TRACK).exits(0);
    told.prints(&["out.jsonl: 12 images", "tracking", "ms"]);
    let words = "bop track --dataset set --scene 1 --object 1 --init init.json --output set.jsonl";
    folder.command(words).exits(0);
    let (lines, expected) = (
        folder.json_lines("out.jsonl"),
        folder.json_lines("set.jsonl"),
    );
    assert_eq!(lines.len(), expected.len());
    for (image, (line, expected)) in lines.iter().zip(&expected).enumerate() {
        assert_eq!(line["depth"], format!("depth/frame-{image}.depth.png"));
        for key in [
            "cam_R_m2c",
            "cam_t_m2c",
            "state",
            "score",
            "evidence",
            "deviation_mm",
            "velocity_mm_per_s",
            "angular_velocity_deg_per_s",
        ] {
            assert!(!line[key].is_null());
            assert_eq!(line[key], expected[key], "{image}: {key}");
        }
    }
    // Files keep the order of the command line.
    let (two, ten) = ("depth/frame-2.depth.png", "depth/frame-10.depth.png");
    let words = TRACK.replace("--depth depth", &format!("--depth {ten} {two}"));
    folder.command(words).exits(0);
    let lines = folder.json_lines("out.jsonl");
    assert_eq!(lines[0]["depth"], ten);
    assert_eq!(lines.len(), 2);
}

#[test]
fn damaged_images_are_reported_and_have_a_predicted_pose() {
    let folder = recording(4);
    let damaged = "depth/frame-2.depth.png";
    folder.write(damaged, "no image");
    folder
        .command(TRACK)
        .fails(&["frame-2.depth.png", "has a predicted pose"]);
    let lines = folder.json_lines("out.jsonl");
    assert_eq!(lines.len(), 4);
    assert_ne!(lines[2]["state"], "tracking");
    let pixels = vec![1.0; 64 * 48];
    let small = hybrid_icp::core::DepthImage::from_meters(64, 48, pixels).unwrap();
    hicp_io::write_depth_png(folder.path(damaged), &small, 1.0).unwrap();
    let sizes = ["frame-2.depth.png: 64x48 pixels, expected 640x480"];
    folder.command(TRACK).fails(&sizes);
    // Also the first image; a hidden file is none.
    folder.write(damaged, folder.bytes("depth/frame-3.depth.png"));
    folder.write("depth/frame-0.depth.png", "no image");
    folder.write("depth/._frame-0.depth.png", "no image");
    folder.command(TRACK).fails(&["1 file could not be used"]);
    assert_eq!(folder.json_lines("out.jsonl").len(), 4);
}

#[test]
fn an_object_that_is_never_tracked_is_warned_of() {
    let folder = recording(2);
    let advice = "tracked in none of its 2 images: do not trust its poses, and check init.json, \
                  --init-unit, set/models/obj_000001.ply, --model-unit, camera.json";
    let words = TRACK.replace("--model-unit mm", "--model-unit m");
    let of_model = "obj_000001.ply: the model's diameter is";
    folder
        .command(words)
        .warns(&[advice, of_model, "check --model-unit m"]);
}

#[test]
fn wrong_inputs_of_a_recording_are_refused() {
    let folder = recording(2);
    folder.create_dir("empty");
    for (from, to, expected) in [
        ("--depth depth", "--depth empty", "no depth image, expected"),
        ("--depth depth", "--depth nowhere", "nowhere"),
        ("--output out.jsonl", "--output init.json", "overwritten"),
        ("--model-unit mm", "", "--model-unit <UNIT> is missing"),
    ] {
        let told = folder.command(TRACK.replace(from, to));
        assert_contains(&told.err, &[expected]);
        assert_ne!(told.code, 0, "{to}");
    }
    folder.change_json("camera.json", |camera| drop(camera["depth_scale"].take()));
    folder
        .command(TRACK)
        .fails(&["camera.json", "depth_scale", "--depth-scale"]);
    assert!(!folder.path("out.jsonl").exists());
}
