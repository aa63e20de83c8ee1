//! JSON files above their limits: each is refused by its size before it is parsed.

use std::path::{Path, PathBuf};

use hicp_io::bop::{Dataset, Scene};
use hicp_io::{IoError, IoErrorKind, ReadLimits, read_camera_json, read_pose_json};

/// Creates a file with a given text, followed by zeros that occupy no disk space.
fn sparse(folder: &Path, name: &str, text: &str, bytes: u64) -> PathBuf {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, text).unwrap();
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(bytes).unwrap();
    path
}

#[track_caller]
fn above<T>(result: Result<T, IoError>, wanted_field: &str, bytes: u64, most: u64) {
    match result.map(|_| ()) {
        Err(
            error @ IoError {
                kind: IoErrorKind::Limit,
                ..
            },
        ) => {
            let message = error.to_string();
            let numbers = format!("found {bytes} bytes, expected at most {most}");
            let option = format!("--{} N", wanted_field.replace('_', "-"));
            assert!(
                message.contains(&numbers) && message.contains(&option),
                "{message}"
            );
        }
        other => panic!("{other:?}"),
    }
}

const POSE: &str = r#"{"cam_R_m2c": [1,0,0,0,1,0,0,0,1], "cam_t_m2c": [0,0,500]}"#;
const CAMERA: &str = r#"{"cam_K": [500,0,3,0,500,3,0,0,1]}"#;

#[test]
fn files_of_a_pose_or_a_camera_have_a_small_limit() {
    let folder = tempfile::tempdir().unwrap();
    let most = ReadLimits::DEFAULT.max_small_json_bytes;
    let pose = sparse(folder.path(), "pose.json", POSE, most + 1);
    above(
        read_pose_json(&pose),
        "max_small_json_bytes",
        most + 1,
        most,
    );
    let camera = sparse(folder.path(), "camera.json", CAMERA, 1 << 40);
    let read = read_camera_json(&camera, (8, 6));
    above(read, "max_small_json_bytes", 1 << 40, most);
    // At the default limit, and at a custom one.
    for (text, bytes) in [(POSE, POSE.len()), (CAMERA, CAMERA.len())] {
        let path = folder.path().join("exact.json");
        std::fs::write(&path, text).unwrap();
        let limits = |max_small_json_bytes| ReadLimits {
            max_small_json_bytes,
            ..ReadLimits::DEFAULT
        };
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
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| sparse(folder.path(), name, text, text.len() as u64);
    for (name, text) in FILES {
        write(name, text);
    }
    let read_all = |limits: ReadLimits| {
        let dataset = Dataset::open(folder.path()).unwrap().with_limits(limits);
        dataset.scene("test", 1)?;
        dataset.read_models_info()?;
        dataset.read_targets().map(|_| ())
    };
    read_all(ReadLimits::DEFAULT).unwrap();
    let most = ReadLimits::DEFAULT.max_json_bytes;
    for (name, text) in FILES {
        sparse(folder.path(), name, text, most + 1);
        above(
            read_all(ReadLimits::DEFAULT),
            "max_json_bytes",
            most + 1,
            most,
        );
        write(name, text);
    }
    let longest = FILES[0].1.len() as u64;
    let limits = |max_json_bytes| ReadLimits {
        max_json_bytes,
        ..ReadLimits::DEFAULT
    };
    assert!(read_all(limits(longest)).is_ok());
    above(
        read_all(limits(longest - 1)),
        "max_json_bytes",
        longest,
        longest - 1,
    );
    let scene = folder.path().join("test/000001");
    above(
        Scene::open_within(limits(10), &scene, None),
        "max_json_bytes",
        longest,
        10,
    );
}
