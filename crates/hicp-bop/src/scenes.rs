//! The images of a dataset's scenes.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use hicp_io::bop::{Dataset, Scene};
use hybrid_icp::core::{ColorImage, DepthImage, Mask, Observation, PinholeCamera};

use crate::fault::{Fault, FaultKind};
use crate::frames::FrameKey;

/// The scenes of a split, opened on request.
///
/// A missing or damaged scene does not affect the others. The annotations of the most recent scenes
/// are kept in memory. Threads may share it.
#[derive(Debug)]
pub struct Scenes {
    dataset: Dataset,
    split: String,
    kept: usize,
    /// The scenes in memory, from the least to the most recently requested.
    open: Mutex<Vec<(u32, Opened)>>,
}

type Opened = Arc<OnceLock<Result<Arc<Scene>, Fault>>>;

/// An image of a scene, with its camera and its depth.
#[derive(Clone, Debug)]
pub struct Image {
    /// The scene of the image.
    pub scene: Arc<Scene>,
    /// Id of the image in the scene.
    pub im_id: u32,
    /// The camera of the image.
    pub camera: PinholeCamera,
    /// The depth image, meters. The observations with all masks share it.
    pub depth: Arc<DepthImage>,
    /// The color image, if it was read ([`Image::read_color`]). All observations share it.
    pub color: Option<Arc<ColorImage>>,
}

impl Image {
    /// Reads the color image of the scene's folder `rgb`, if there is one.
    ///
    /// # Errors
    ///
    /// [`Fault`] if the color image is damaged or has another size than the depth image.
    pub fn read_color(&mut self) -> Result<(), Fault> {
        let color = self.scene.read_color(self.im_id);
        self.color = color.map_err(|e| Fault::of(&e))?.map(Arc::new);
        let expected = (self.depth.width(), self.depth.height());
        let other = |color: &mut Arc<ColorImage>| expected != (color.width(), color.height());
        match self.color.take_if(other) {
            None => Ok(()),
            Some(color) => Err(Fault::damaged(format!(
                "{}: {}x{} pixels, expected {}x{} as the depth image",
                self.scene
                    .color_path(self.im_id)
                    .unwrap_or_default()
                    .display(),
                color.width(),
                color.height(),
                expected.0,
                expected.1,
            ))),
        }
    }

    /// Creates the observation of the image with a mask.
    pub(crate) fn observe(&self, mask: Mask) -> Result<Observation, Fault> {
        let observation = Observation::new(Arc::clone(&self.depth), mask, self.camera);
        let observation = observation.and_then(|observation| match &self.color {
            Some(color) => observation.with_color(Arc::clone(color)),
            None => Ok(observation),
        });
        observation.map_err(|error| Fault::damaged(error.to_string()))
    }
}

impl Scenes {
    /// Creates the scenes of a split, of which at most `kept` stay in memory, at least one.
    ///
    /// If each thread processes its images in the order of their scenes, the number of threads plus
    /// one is sufficient.
    #[must_use]
    pub fn new(dataset: &Dataset, split: &str, kept: usize) -> Self {
        Self {
            dataset: dataset.clone(),
            split: split.to_owned(),
            kept: kept.max(1),
            open: Mutex::default(),
        }
    }

    /// Returns a scene, and opens it if it is not in memory.
    ///
    /// # Errors
    ///
    /// [`Fault`] if the scene is missing or an annotation file is damaged.
    pub fn get(&self, scene_id: u32) -> Result<Arc<Scene>, Fault> {
        let opened = self.entry(scene_id);
        // Open outside the lock, so that other scenes can be opened at the same time. `OnceLock`
        // opens this one once.
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

    /// Reads the camera and the depth of an image, without its color.
    ///
    /// # Errors
    ///
    /// [`Fault`] if the image, its camera or its depth is missing or damaged.
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
            let file = scene.file("scene_camera");
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
            color: None,
        })
    }
}

/// Smallest visible fraction of an instance that the BOP benchmark requests.
pub const MIN_VISIBLE_FRACTION: f64 = 0.1;

/// Returns whether the file of visibilities states that of every instance in an image.
#[must_use]
pub fn states_visibility(scene: &Scene, im_id: u32) -> bool {
    let infos = scene.ground_truth_info(im_id).unwrap_or_default();
    let stated = infos.iter().filter(|info| info.visible_fraction.is_some());
    stated.count() >= scene.ground_truth(im_id).map_or(0, <[_]>::len)
}

/// Returns the ids of the objects in an image that are visible enough to be targets, one per
/// instance.
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
