//! A dataset with one image of a block.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hicp_bop::{Image, ModelFolder, Models, Scenes};
use hicp_io::bop::{Dataset, GroundTruth, SceneCamera, write_scene_camera, write_scene_gt};
use hicp_io::{LengthUnit, write_depth_png, write_mask_png, write_ply};
use hybrid_icp::core::{
    DepthImage, Isometry3, Mask, Matrix3, Model, PinholeCamera, Point3, TriMesh, Vector3,
};
use hybrid_icp::raster::render_depth_image;
use tempfile::TempDir;

pub(crate) const KEY: (u32, u32) = (1, 4);
pub(crate) const BLOCK: u32 = 5;

/// Returns a block of 6 × 8 × 10 cm.
fn block() -> TriMesh {
    let corner = |i: u8| {
        let side = |bit: u8, half: f32| if i & bit == 0 { -half } else { half };
        Point3::new(side(1, 0.03), side(2, 0.04), side(4, 0.05))
    };
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    TriMesh::new((0..8).map(corner).collect(), triangles.collect()).unwrap()
}

fn camera() -> PinholeCamera {
    PinholeCamera::new(200.0, 200.0, 79.5, 59.5, 160, 120).unwrap()
}

pub(crate) fn truth() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.02, -0.01, 0.5), Vector3::new(0.5, 0.9, 0.3))
}

pub(crate) fn estimate() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.004, -0.003, 0.004), Vector3::zeros()) * truth()
}

/// Returns the depth of the block alone.
fn depth() -> DepthImage {
    render_depth_image(&block(), &camera(), &truth())
}

pub(crate) fn mask() -> Mask {
    Mask::measured(&depth())
}

/// A dataset with one image of the block, and its models. The object 9 has none.
pub(crate) struct World {
    pub(crate) dataset: Dataset,
    pub(crate) models: Models,
    _folder: TempDir,
}

impl World {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let dataset = dataset(folder.path());
        let read = ModelFolder::open(dataset.models_dir().unwrap()).unwrap();
        Self {
            models: Models::read(&read, &[BLOCK, 9].into()),
            dataset,
            _folder: folder,
        }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.dataset.root().join(name)
    }

    pub(crate) fn scenes(&self) -> Scenes {
        Scenes::new(&self.dataset, "test", 1)
    }

    pub(crate) fn image(&self) -> Image {
        self.scenes().read(KEY).unwrap()
    }

    pub(crate) fn model(&self) -> &Model {
        &self.models.by_id[&BLOCK]
    }
}

/// Writes a dataset with one image of the block.
fn dataset(dir: &Path) -> Dataset {
    let scene = dir.join("test/000001");
    for folder in ["depth", "mask_visib"] {
        std::fs::create_dir_all(scene.join(folder)).unwrap();
    }
    std::fs::create_dir(dir.join("models")).unwrap();
    write_ply(
        dir.join("models/obj_000005.ply"),
        &block(),
        LengthUnit::Millimeters,
    )
    .unwrap();
    write_depth_png(scene.join("depth/000004.png"), &depth(), 0.1).unwrap();
    write_mask_png(scene.join("mask_visib/000004_000000.png"), &mask()).unwrap();
    let seen_by = SceneCamera {
        matrix: Matrix3::new(200.0, 0.0, 79.5, 0.0, 200.0, 59.5, 0.0, 0.0, 1.0),
        image_size: None,
        depth_scale: Some(0.1),
        camera_from_world: None,
    };
    let there = GroundTruth {
        obj_id: BLOCK,
        camera_from_object: truth(),
    };
    write_scene_camera(
        scene.join("scene_camera.json"),
        &BTreeMap::from([(4, seen_by)]),
    )
    .unwrap();
    write_scene_gt(
        scene.join("scene_gt.json"),
        &BTreeMap::from([(4, vec![there])]),
    )
    .unwrap();
    Dataset::open(dir).unwrap()
}
