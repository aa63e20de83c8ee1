//! Paths in BOP's dataset layout.

use std::path::Path;

use hicp_io::bop::{Dataset, Scene};

#[test]
fn models_and_masks_have_six_digits() {
    assert_eq!(
        Dataset::model_path_in(Path::new("models"), 7),
        Path::new("models/obj_000007.ply")
    );
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("scene_camera.json"), "{}").unwrap();
    let scene = Scene::open(dir.path()).unwrap();
    assert_eq!(
        scene.visible_mask_path(12, 3),
        dir.path().join("mask_visib/000012_000003.png")
    );
}
