//! JSON files above their limits: each is refused by its size before it is parsed.

use hicp_io::bop::{Dataset, Scene};
use hicp_io::{IoError, IoErrorKind, ReadLimits, read_camera_json, read_pose_json};

use crate::common::{Folder, limits, refused};

#[track_caller]
fn above<T>(result: Result<T, IoError>, wanted_field: &str, bytes: u64, most: u64) {
    let numbers = format!("found {bytes} bytes, expected at most {most}");
    let option = format!("--{} N", wanted_field.replace('_', "-"));
    let error = refused(result, &[&numbers, &option]);
    assert_eq!(error.kind, IoErrorKind::Limit);
}

const POSE: &str = r#"{"cam_R_m2c": [1,0,0,0,1,0,0,0,1], "cam_t_m2c": [0,0,500]}"#;
const CAMERA: &str = r#"{"cam_K": [500,0,3,0,500,3,0,0,1]}"#;

#[test]
fn files_of_a_pose_or_a_camera_have_a_small_limit() {
    let folder = Folder::new();
    let most = ReadLimits::DEFAULT.max_small_json_bytes;
    let pose = folder.sparse("pose.json", POSE, most + 1);
    above(
        read_pose_json(&pose),
        "max_small_json_bytes",
        most + 1,
        most,
    );
    let camera = folder.sparse("camera.json", CAMERA, 1 << 40);
    let read = read_camera_json(&camera, (8, 6));
    above(read, "max_small_json_bytes", 1 << 40, most);
    // At the default limit, and at a custom one.
    for (text, bytes) in [(POSE, POSE.len()), (CAMERA, CAMERA.len())] {
        let path = folder.write("exact.json", text);
        let limits = |bytes| limits(|limits| limits.max_small_json_bytes = bytes);
        let read = |limits: ReadLimits| match text {
            POSE => limits.read_pose_json(&path).map(|_| ()),
            _ => limits.read_camera_json(&path, (8, 6)).map(|_| ()),
        };
        let bytes = bytes as u64;
        assert!(read(limits(bytes)).is_ok());
        above(
            read(limits(bytes - 1)),
            "max_small_json_bytes",
            bytes,
            bytes - 1,
        );
    }
}

#[test]
fn every_annotation_file_of_a_dataset_is_limited() {
    const FILES: [(&str, &str); 5] = [
        (
            "test/000001/scene_camera.json",
            "{\"0\":{\"cam_K\":[500,0,3,0,500,3,0,0,1]}}",
        ),
        ("test/000001/scene_gt.json", "{}"),
        ("test/000001/scene_gt_info.json", "{}"),
        ("models/models_info.json", "{}"),
        ("test_targets_bop19.json", "[]"),
    ];
    let folder = Folder::new();
    for (name, text) in FILES {
        folder.write(name, text);
    }
    let read_all = |limits: ReadLimits| {
        let dataset = Dataset::open(folder.root()).unwrap().with_limits(limits);
        dataset.scene("test", 1)?;
        dataset.read_models_info()?;
        dataset.read_targets().map(|_| ())
    };
    read_all(ReadLimits::DEFAULT).unwrap();
    let most = ReadLimits::DEFAULT.max_json_bytes;
    for (name, text) in FILES {
        folder.sparse(name, text, most + 1);
        above(
            read_all(ReadLimits::DEFAULT),
            "max_json_bytes",
            most + 1,
            most,
        );
        folder.write(name, text);
    }
    let longest = FILES[0].1.len() as u64;
    let limits = |bytes| limits(|limits| limits.max_json_bytes = bytes);
    assert!(read_all(limits(longest)).is_ok());
    above(
        read_all(limits(longest - 1)),
        "max_json_bytes",
        longest,
        longest - 1,
    );
    let scene = folder.path("test/000001");
    above(
        Scene::open_within(limits(10), &scene, None),
        "max_json_bytes",
        longest,
        10,
    );
}
