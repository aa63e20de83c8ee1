//! Writers refuse numbers that no file can hold, instead of leaving the fault to readers.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use hicp_core::{Isometry3, Matrix3};
use hicp_io::bop::{ResultRow, SceneCamera, write_results, write_scene_camera};
use hicp_io::{IoError, IoErrorKind, write_pose_json};

fn refused(path: &Path, written: Result<(), IoError>, place: &str) {
    match written {
        Err(error) if error.kind == IoErrorKind::Write => {
            let text = error.source().unwrap().to_string();
            assert!(
                text.starts_with(place) && text.contains("not a finite number"),
                "{text}"
            );
        }
        other => panic!("{place}: {other:?}"),
    }
    assert!(!path.exists());
}

#[test]
fn writers_refuse_numbers_that_readers_would_refuse() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    // Finite in meters, but above the range of numbers in millimeters.
    let far = Isometry3::translation(1e306, 0.0, 0.0);
    refused(&path, write_pose_json(&path, &far), "$.cam_t_m2c[0]");

    let row = ResultRow::new(1, 2, 3, Isometry3::identity());
    type Spoil = fn(&mut ResultRow);
    let spoils: [(&str, Spoil); 3] = [
        ("score of row 2", |row| row.score = f64::NAN),
        ("time of row 2", |row| row.time_s = Some(f64::INFINITY)),
        ("t of row 2", |row| {
            row.set_camera_from_object(Isometry3::translation(0.0, 0.0, 1e306));
        }),
    ];
    for (place, spoil) in spoils {
        let mut bad = row.clone();
        spoil(&mut bad);
        refused(&path, write_results(&path, &[row.clone(), bad]), place);
    }

    let camera = SceneCamera {
        matrix: Matrix3::identity(),
        image_size: None,
        depth_scale: Some(f64::NAN),
        camera_from_world: None,
    };
    let cameras = BTreeMap::from([(7, camera)]);
    refused(
        &path,
        write_scene_camera(&path, &cameras),
        "$.7.depth_scale",
    );
}
