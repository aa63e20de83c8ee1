//! Paths in BOP's dataset layout.

use std::path::Path;

use hicp_io::bop::{Dataset, Scene};

use crate::common::Folder;

#[test]
fn models_and_masks_have_six_digits() {
    assert_eq!(
        Dataset::model_path_in(Path::new("models"), 7),
        Path::new("models/obj_000007.ply")
    );
    let folder = Folder::new();
    folder.write("scene_camera.json", "{}");
    let scene = Scene::open(folder.root()).unwrap();
    let mask = folder.path("mask_visib/000012_000003.png");
    assert_eq!(scene.visible_mask_path(12, 3), mask);
}
