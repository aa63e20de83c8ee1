//! The images of a dataset's scenes.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use hicp_io::bop::{Dataset, Scene};
use hybrid_icp::core::{DepthImage, ImageError, Mask, Observation, PinholeCamera};

use crate::fault::{Fault, FaultKind};
use crate::frames::FrameKey;

/// The scenes of a split, opened when they are asked for; each may be missing or damaged without harm to the others.
///
/// The annotations of the last few scenes are kept, not those of the dataset. Threads may share it.
#[derive(Debug)]
pub struct Scenes {
    dataset: Dataset,
    split: String,
    kept: usize,
    /// Those kept, the one last asked for at the end.
    open: Mutex<Vec<(u32, Opened)>>,
}

type Opened = Arc<OnceLock<Result<Arc<Scene>, Fault>>>;

/// An image with what the files say of it.
#[derive(Clone, Debug)]
pub struct Image {
    /// Its scene.
    pub scene: Arc<Scene>,
    /// Its id in the scene.
    pub im_id: u32,
    /// Its camera.
    pub camera: PinholeCamera,
    /// Its depth, metres; the observations of all its masks share it.
    pub depth: Arc<DepthImage>,
}

impl Image {
    /// Creates the observation of the image in a mask.
    pub(crate) fn observe(&self, mask: Mask) -> Result<Observation, ImageError> {
        Observation::new(Arc::clone(&self.depth), mask, self.camera)
    }
}

impl Scenes {
    /// The scenes of a split, of which at most `kept` are in memory, at least one.
    ///
    /// One more than there are threads is enough when each works through its images in the order of their scenes.
    #[must_use]
    pub fn new(dataset: &Dataset, split: &str, kept: usize) -> Self {
        Self {
            dataset: dataset.clone(),
            split: split.to_owned(),
            kept: kept.max(1),
            open: Mutex::default(),
        }
    }

    /// Returns a scene, opened if it is not in memory.
    ///
    /// # Errors
    ///
    /// A [`Fault`] when the scene is not there or an annotation file is damaged.
    pub fn get(&self, scene_id: u32) -> Result<Arc<Scene>, Fault> {
        let opened = self.entry(scene_id);
        // Outside the lock: other scenes can be opened meanwhile, this one is opened once.
        let scene = opened.get_or_init(|| {
            let scene = self.dataset.scene(&self.split, scene_id);
            scene.map(Arc::new).map_err(|error| Fault::of(&error))
        });
        scene.clone()
    }

    fn entry(&self, scene_id: u32) -> Opened {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = match open.iter().position(|(id, _)| *id == scene_id) {
            Some(place) => open.remove(place),
            None => (scene_id, Opened::default()),
        };
        let opened = entry.1.clone();
        if open.len() >= self.kept {
            open.remove(0);
        }
        open.push(entry);
        opened
    }

    /// Reads the camera and the depth of an image.
    ///
    /// # Errors
    ///
    /// A [`Fault`] when the image, its camera or its depth is missing or damaged.
    pub fn read(&self, (scene_id, im_id): FrameKey) -> Result<Image, Fault> {
        let scene = self.get(scene_id)?;
        let camera = scene.camera(im_id).map_err(|e| Fault {
            kind: match scene.image_ids().any(|id| id == im_id) {
                true => FaultKind::Damaged,
                false => FaultKind::Missing,
            },
            ..Fault::of(&e)
        })?;
        let depth = scene.read_depth(im_id).map_err(|e| Fault::of(&e))?;
        let place = |key: &str| {
            let file = scene.dir().join("scene_camera.json");
            format!("{}, $.{im_id}.{key}", file.display())
        };
        let size = (depth.width(), depth.height());
        if let Some((width, height)) = camera.image_size.filter(|stated| *stated != size) {
            let place = place("cam_model");
            return Err(Fault::damaged(format!(
                "{place}: images of {width}x{height}, expected {}x{} as the depth image",
                size.0, size.1
            )));
        }
        let camera = camera
            .pinhole(size.0, size.1)
            .map_err(|e| Fault::damaged(format!("{}: {e}", place("cam_K"))))?;
        Ok(Image {
            scene,
            im_id,
            camera,
            depth: Arc::new(depth),
        })
    }
}

/// Visible part from which the BOP benchmark requests an instance.
pub const MIN_VISIBLE_FRACTION: f64 = 0.1;

/// Returns the objects in an image that are visible enough to be targets, an entry per instance.
///
/// An instance without a stated visibility counts as visible.
#[must_use]
pub fn visible_objects(scene: &Scene, im_id: u32) -> Vec<u32> {
    let infos = scene.ground_truth_info(im_id).unwrap_or_default();
    let is_visible = |index: usize| {
        let stated = infos.get(index).and_then(|info| info.visible_fraction);
        stated.is_none_or(|fraction| fraction >= MIN_VISIBLE_FRACTION)
    };
    let truths = scene.ground_truth(im_id).unwrap_or_default();
    let visible = truths.iter().enumerate();
    let visible = visible.filter(|(index, _)| is_visible(*index));
    visible.map(|(_, truth)| truth.obj_id).collect()
}
