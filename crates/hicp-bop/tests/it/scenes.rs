//! The scenes that are kept in memory.

use std::sync::Arc;

use hicp_bop::{FaultKind, Scenes};
use hicp_io::bop::Dataset;

fn dataset(scenes: &[u32]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for id in scenes {
        let scene = dir.path().join(format!("val/{id:06}"));
        std::fs::create_dir_all(&scene).unwrap();
        let camera = r#"{"3": {"cam_K": [9, 0, 1, 0, 9, 1, 0, 0, 1]}}"#;
        std::fs::write(scene.join("scene_camera.json"), camera).unwrap();
    }
    dir
}

#[test]
fn only_the_most_recent_scenes_are_kept() {
    let dir = dataset(&[1, 2, 3]);
    let scenes = Scenes::new(&Dataset::open(dir.path()).unwrap(), "val", 2);
    let first = scenes.get(1).unwrap();
    let second = scenes.get(2).unwrap();
    assert!(Arc::ptr_eq(&first, &scenes.get(1).unwrap()));
    // The third scene replaces the second, which is the least recently requested.
    scenes.get(3).unwrap();
    assert!(Arc::ptr_eq(&first, &scenes.get(1).unwrap()));
    assert_eq!(Arc::strong_count(&second), 1);
    assert!(!Arc::ptr_eq(&second, &scenes.get(2).unwrap()));
    assert_eq!(scenes.get(2).unwrap().image_ids().collect::<Vec<_>>(), [3]);
}

#[test]
fn missing_and_damaged_scenes_are_reported() {
    let dir = dataset(&[1, 2]);
    let file = dir.path().join("val/000002/scene_camera.json");
    std::fs::write(&file, "{").unwrap();
    // At least one scene is kept, even with room for none.
    let scenes = Scenes::new(&Dataset::open(dir.path()).unwrap(), "val", 0);
    let missing = scenes.get(9).unwrap_err();
    assert!(
        missing.kind == FaultKind::Missing && missing.text.contains("000009"),
        "{missing:?}"
    );
    let damaged = scenes.get(2).unwrap_err();
    assert!(damaged.kind == FaultKind::Damaged && damaged.text.contains("scene_camera.json"));
    let fault = scenes.read((1, 4)).unwrap_err();
    assert!(
        fault.kind == FaultKind::Missing && fault.text.contains("image 4"),
        "{fault:?}"
    );
    let fault = scenes.read((1, 3)).unwrap_err();
    assert!(
        fault.kind == FaultKind::Missing && fault.text.contains("000003.png"),
        "{fault:?}"
    );
}
