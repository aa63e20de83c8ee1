//! Following an object from image to image.

use hicp_bop::chain;
use hicp_io::bop::Scene;
use hicp_io::{IoError, IoErrorKind};
use hybrid_icp::fusion::CameraMotion;
use hybrid_icp::{
    DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, SequentialEstimator, Warning,
    render_depth_image, warnings,
};

use super::lines::Line;

const NO_IMAGE: &str = "moved with the camera: no depth image";
const NO_MASK: &str = "moved with the camera: no mask of the object";
const NO_OVERLAP: &str = "moved with the camera: no overlap with a mask of the object";
const DAMAGED: &str = "moved with the camera: damaged file";

/// Feeds the images of a scene to an estimator.
pub(super) struct Tracker<'a> {
    scene: &'a Scene,
    model: &'a Model,
    object: u32,
    estimator: SequentialEstimator,
    /// What is wrong with files, each once.
    damaged: Vec<String>,
    /// What looks wrong in the first image that was registered: units and scales are those of all of them.
    warnings: Option<(u32, Vec<Warning>)>,
}

impl<'a> Tracker<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        model: &'a Model,
        object: u32,
        estimator: SequentialEstimator,
    ) -> Self {
        Self {
            scene,
            model,
            object,
            estimator,
            damaged: Vec::new(),
            warnings: None,
        }
    }

    /// What looks wrong about the inputs, and the image that it was seen in.
    pub(super) fn warnings(&self) -> impl Iterator<Item = (u32, &Warning)> {
        let warnings = self.warnings.iter();
        warnings.flat_map(|(im_id, warnings)| warnings.iter().map(|warning| (*im_id, warning)))
    }

    /// Messages about files that could not be used.
    pub(super) fn into_damaged(self) -> Vec<String> {
        self.damaged
    }

    /// Takes in an image; what cannot be registered moves the pose with the camera.
    pub(super) fn image(&mut self, im_id: u32, motion: &CameraMotion) -> Line {
        let predicted = motion.apply(&self.estimator.camera_from_object());
        match self.observe(im_id, &predicted) {
            Ok((instance, observation)) => {
                self.warnings
                    .get_or_insert_with(|| (im_id, warnings(self.model, &observation, &predicted)));
                let step = self.estimator.step(self.model, &observation, motion);
                let mut line = Line::registered(im_id, instance, step);
                line.off = self.off(&line);
                line
            }
            Err(why) => {
                self.estimator.move_camera(motion);
                let covariance = self.estimator.estimate().map(|fused| *fused.covariance());
                Line::moved(im_id, why, self.estimator.camera_from_object(), covariance)
            }
        }
    }

    /// Cuts the object out of an image: the instance whose visible mask it overlaps most at the predicted pose, the first among equals.
    fn observe(
        &mut self,
        im_id: u32,
        predicted: &Isometry3<f64>,
    ) -> Result<(usize, Observation), &'static str> {
        let (camera, depth) = self.read(im_id)?;
        let rendered = render_depth_image(self.model.mesh(), &camera, predicted);
        let truths = self.scene.ground_truth(im_id).unwrap_or_default();
        let instances = truths.iter().enumerate();
        let mut best: Option<(usize, usize, Mask)> = None;
        let mut why = NO_MASK;
        for (instance, _) in instances.filter(|(_, truth)| truth.obj_id == self.object) {
            let mask = match self.scene.read_visible_mask(im_id, instance) {
                Ok(mask) => mask,
                Err(error) if error.kind == IoErrorKind::Missing => continue,
                Err(error) => return Err(self.complain_of(&error)),
            };
            why = NO_OVERLAP;
            let pixels = rendered.pixels().iter().zip(mask.pixels());
            let overlap = pixels.filter(|(z, set)| **z > 0.0 && **set).count();
            if overlap > best.as_ref().map_or(0, |(most, ..)| *most) {
                best = Some((overlap, instance, mask));
            }
        }
        let (_, instance, mask) = best.ok_or(why)?;
        let observation = Observation::new(depth, mask, camera).map_err(|error| {
            let path = self.scene.visible_mask_path(im_id, instance);
            self.damaged.push(format!("{}: {error}", path.display()));
            DAMAGED
        })?;
        Ok((instance, observation))
    }

    fn read(&mut self, im_id: u32) -> Result<(PinholeCamera, DepthImage), &'static str> {
        let depth = match self.scene.read_depth(im_id) {
            Ok(depth) => depth,
            Err(error) if error.kind == IoErrorKind::Missing => return Err(NO_IMAGE),
            Err(error) => return Err(self.complain_of(&error)),
        };
        let camera = match self.scene.camera(im_id) {
            Ok(camera) => camera.pinhole(depth.width(), depth.height()),
            Err(error) => return Err(self.complain_of(&error)),
        };
        match camera {
            Ok(camera) => Ok((camera, depth)),
            Err(error) => {
                let file = self.scene.dir().join("scene_camera.json");
                self.damaged
                    .push(format!("{}, $.{im_id}.cam_K: {error}", file.display()));
                Err(DAMAGED)
            }
        }
    }

    fn complain_of(&mut self, error: &IoError) -> &'static str {
        self.damaged.push(chain(error));
        DAMAGED
    }

    /// How far the object's centre is from the truth, from the image alone and fused, metres.
    fn off(&self, line: &Line) -> Option<(f64, f64)> {
        let truth = self.scene.ground_truth(line.im_id)?.get(line.instance?)?;
        let center = self.model.center();
        let expected = truth.camera_from_object * center;
        let off = |pose: &Isometry3<f64>| (pose * center - expected).norm();
        let single = line.single.as_ref()?;
        Some((off(&single.outcome.camera_from_object), off(&line.fused)))
    }
}
