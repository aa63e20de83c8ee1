//! The images of a dataset's scenes.

use std::collections::BTreeMap;

use hicp_io::bop::{Dataset, Scene};
use hybrid_icp::{DepthImage, PinholeCamera};

use super::problem::Problem;

/// Scenes of a split, opened once; each may be missing or damaged without harm to the others.
#[derive(Debug)]
pub(crate) struct Scenes(BTreeMap<u32, Result<Scene, Problem>>);

/// An image with what the files say of it.
#[derive(Clone, Debug)]
pub(crate) struct Image<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) im_id: u32,
    pub(crate) camera: PinholeCamera,
    pub(crate) depth: DepthImage,
}

impl Scenes {
    /// Opens the scenes named, each once.
    pub(crate) fn open(dataset: &Dataset, split: &str, ids: impl Iterator<Item = u32>) -> Self {
        let mut scenes = BTreeMap::new();
        for id in ids {
            scenes.entry(id).or_insert_with(|| {
                let scene = dataset.scene(split, id);
                scene.map_err(|error| Problem::of(&error))
            });
        }
        Self(scenes)
    }

    /// Returns a scene that was opened, or why it cannot be used.
    pub(crate) fn get(&self, scene_id: u32) -> Result<&Scene, Problem> {
        match self.0.get(&scene_id) {
            Some(Ok(scene)) => Ok(scene),
            Some(Err(problem)) => Err(problem.clone()),
            None => Err(Problem::damaged(format!(
                "scene {scene_id} was not prepared"
            ))),
        }
    }

    /// Reads the camera and the depth of an image.
    pub(crate) fn read(&self, scene_id: u32, im_id: u32) -> Result<Image<'_>, Problem> {
        let scene = self.get(scene_id)?;
        let camera = scene.camera(im_id).map_err(|e| Problem {
            missing: !scene.image_ids().any(|id| id == im_id),
            ..Problem::of(&e)
        })?;
        let depth = scene.read_depth(im_id).map_err(|e| Problem::of(&e))?;
        let camera = camera.pinhole(depth.width(), depth.height()).map_err(|e| {
            let file = scene.dir().join("scene_camera.json");
            Problem::damaged(format!("{}, $.{im_id}.cam_K: {e}", file.display()))
        })?;
        Ok(Image {
            scene,
            im_id,
            camera,
            depth,
        })
    }
}
