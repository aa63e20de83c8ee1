//! Follows an object from image to image.

use hicp_bop::{Fault, MaskSource, RowStatus, Scenes};
use hybrid_icp::core::{Isometry3, Model};
use hybrid_icp::fusion::CameraMotion;
use hybrid_icp::{MotionCheck, Preset, Refiner, SequentialEstimator, Warning, warnings};

use super::line::Line;

/// Feeds the images of a scene to an estimator.
pub(super) struct Tracker<'a> {
    scenes: &'a Scenes,
    scene: u32,
    object: u32,
    model: &'a Model,
    masks: &'a MaskSource,
    estimator: SequentialEstimator,
    /// Renders the model to select a mask, and judges the fused pose.
    refiner: Refiner,
    pub(super) check: MotionCheck,
    /// The number of images without a mask of the object.
    pub(super) unmasked: usize,
    /// Files that were missing or damaged.
    pub(super) faults: Vec<Fault>,
    /// Warnings about the first registered image; the other images have the same units and scales.
    pub(super) warnings: Option<(u32, Vec<Warning>)>,
}

impl<'a> Tracker<'a> {
    pub(super) fn new(
        scenes: &'a Scenes,
        (scene, object): (u32, u32),
        model: &'a Model,
        masks: &'a MaskSource,
        estimator: SequentialEstimator,
    ) -> Self {
        Self {
            scenes,
            scene,
            object,
            model,
            masks,
            estimator,
            refiner: Refiner::preset(Preset::Hybrid),
            check: MotionCheck::default(),
            unmasked: 0,
            faults: Vec::new(),
            warnings: None,
        }
    }

    /// Registers an image. Without an estimate, the pose moves with the camera.
    pub(super) fn image(&mut self, im_id: u32, motion: &CameraMotion) -> Line {
        let predicted = motion.apply(&self.estimator.camera_from_object());
        self.register(im_id, motion, &predicted)
            .unwrap_or_else(|status| {
                let why = match status {
                    RowStatus::NoMask => {
                        self.unmasked += 1;
                        "moved with the camera: no mask of the object"
                    }
                    RowStatus::NoOverlap => {
                        self.check.miss();
                        "moved with the camera: no overlap with a mask of the object"
                    }
                    RowStatus::MissingFrame => "moved with the camera: no depth image",
                    _ => "moved with the camera: damaged file",
                };
                self.estimator.move_camera(motion);
                let covariance = self.estimator.estimate().map(|fused| *fused.covariance());
                Line::moved(im_id, why, self.estimator.camera_from_object(), covariance)
            })
    }

    /// Registers an image in one mask of the object.
    ///
    /// It is the mask that the model overlaps most at the predicted pose.
    fn register(
        &mut self,
        im_id: u32,
        motion: &CameraMotion,
        predicted: &Isometry3<f64>,
    ) -> Result<Line, RowStatus> {
        let key = (self.scene, im_id);
        let image = self.scenes.read(key).map_err(|fault| {
            let status = RowStatus::from(&fault);
            self.faults.push(fault);
            status
        })?;
        let truths = image.scene.ground_truth(im_id).unwrap_or_default().to_vec();
        let mut image = self.masks.frame(key, image);
        let masks = image.choose(&mut self.refiner, self.model, self.object, &[*predicted]);
        let mask = masks.into_iter().next().unwrap_or(Err(RowStatus::NoMask));
        let line = mask.and_then(|mask| {
            let observation = image.observation(mask)?;
            let model = self.model;
            self.warnings
                .get_or_insert_with(|| (im_id, warnings(model, observation, predicted)));
            let step = self.estimator.step(model, observation, motion);
            self.check.add(&step.event);
            let fused = step.camera_from_object;
            let confidence = self.refiner.judge(model, observation, &fused).confidence;
            // The visible masks are those of the instances, in their order.
            let instance = matches!(self.masks, MaskSource::Visible).then_some(mask);
            let mut line = Line::registered(im_id, instance, step, confidence);
            let truth = instance.and_then(|instance| truths.get(instance));
            if let (Some((single, _)), Some(truth)) = (&line.single, truth) {
                let expected = truth.camera_from_object * model.center();
                let off = |pose: &Isometry3<f64>| (pose * model.center() - expected).norm();
                line.off = Some((off(&single.camera_from_object), off(&line.fused)));
            }
            Ok(line)
        });
        self.faults.extend(image.into_faults());
        line
    }
}
