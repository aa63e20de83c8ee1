//! Noisy models: objects reconstructed from noisy images (§VI-B.3).

use hicp_core::{Isometry3, Model, ModelConfig, PinholeCamera, Vector3};
use hicp_raster::render_depth_image;

use crate::SimRng;
use crate::error::{SimError, check_range};
use crate::sampling::{object_pose, perturb};
use crate::sensor::{DepthNoise, RelativeGaussian};
use crate::stream::stream;
use crate::tsdf::{TsdfConfig, TsdfVolume};
use crate::tsdf::{components, join};

/// The errors of the images from which a model is reconstructed.
// Deviation: object instead of camera poses: §VI-C.2 reconstructs with wrong camera poses. By
// default, the object's poses are wrong here, as in §VI-B.3. A camera turned by 1.1° moves a
// surface by 1 cm, in which thin walls are lost.
// Deviation: noise-free model images: §VI-C.2 reconstructs from images with D435 noise. By default,
// these images have no noise here, so that the wrong poses are the only error of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReconstructionNoise {
    /// Error added to all four camera parameters, pixels.
    pub intrinsics_pixels: f64,
    /// Noise of the depth images.
    pub depth: DepthNoise,
    /// Translation error of every pose, meters.
    pub translation_meters: f64,
    /// Rotation error of every pose, degrees.
    pub rotation_degrees: f64,
    /// The pose that has these errors.
    pub wrong_pose: WrongPose,
}

/// The pose that is wrong in each image of a reconstruction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum WrongPose {
    /// The object's pose: the errors rotate the object around its origin (§VI-B.3).
    #[default]
    Object,
    /// The camera's pose: the errors rotate the camera around its center (§VI-C.2).
    ///
    /// They move the surface in proportion to its distance.
    Camera,
}

impl ReconstructionNoise {
    /// Returns noise level i of §VI-B.3.
    ///
    /// The errors are (i − 1)/2 pixels, (i − 1) % of the depth, (i − 1) mm and (i − 1)°.
    /// The paper has levels 1 to 4. Level 1 is a perfect sensor; its only error is the resolution
    /// of the volume.
    ///
    /// # Errors
    ///
    /// [`SimError::Parameter`] if the level is not in 1 to 4.
    pub fn level(level: u32) -> Result<Self, SimError> {
        check_range("reconstruction level", f64::from(level), 1.0..=4.0)?;
        let steps = f64::from(level - 1);
        Ok(Self {
            intrinsics_pixels: 0.5 * steps,
            depth: DepthNoise::Relative(RelativeGaussian { percent: steps }),
            translation_meters: 1e-3 * steps,
            rotation_degrees: steps,
            wrong_pose: WrongPose::Object,
        })
    }

    /// Returns a wrong pose (`camera_from_object`).
    fn disturbed(&self, rng: &mut SimRng, truth: &Isometry3<f64>) -> Isometry3<f64> {
        let mut perturb = |pose| {
            perturb(
                rng,
                &pose,
                self.translation_meters,
                self.rotation_degrees.to_radians(),
            )
        };
        match self.wrong_pose {
            WrongPose::Object => perturb(*truth),
            WrongPose::Camera => perturb(truth.inverse()).inverse(),
        }
    }
}

/// The settings of a reconstruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reconstruction {
    /// The camera of the images.
    pub camera: PinholeCamera,
    /// Number of images; the paper uses 100.
    pub images: u32,
    /// Largest distance of the object's center, meters.
    ///
    /// The smallest distance is the object's diameter (§VI-A.3).
    pub max_distance_meters: f64,
    /// Largest distance between the object's center and the optical axis, meters.
    pub axis_offset_meters: f64,
    /// Distance between voxels, meters.
    pub voxel_meters: f64,
    /// Truncation of the volume, meters; `None` for [`Reconstruction::truncation_meters`].
    pub truncation_meters: Option<f64>,
    /// The errors of the images.
    pub noise: ReconstructionNoise,
}

/// Smallest area of a component to keep, as a share of the largest component's area. Noise leaves
/// smaller specks in the air.
// Open: parts of reconstructions that are kept: §VI-B.3. Share of the largest part's area; noise
// leaves specks in the air.
pub const MIN_COMPONENT_SHARE: f64 = 0.05;

impl Reconstruction {
    /// Returns the setting of §VI-B.3: 100 images, the distances of the studies, and voxels of 2.5
    /// mm.
    ///
    /// The paper does not state the voxel size.
    #[must_use]
    pub fn new(camera: PinholeCamera, noise: ReconstructionNoise) -> Self {
        Self {
            camera,
            images: 100,
            // Open: images of reconstructions: §VI-B.3. Their object poses are drawn like those of
            // §VI-A.3, up to this distance in meters.
            max_distance_meters: 0.6,
            axis_offset_meters: 0.02,
            // Open: voxels of reconstructions: §VI-B.3. Meters. Smaller ones cost time with the
            // third power; walls of the objects have 2 mm and more.
            voxel_meters: 0.0025,
            truncation_meters: None,
            noise,
        }
    }

    /// Returns the default truncation for a model, meters.
    ///
    /// It is three voxels plus 2.5 standard deviations of a measured surface along a ray, because
    /// the noise of the depth and the errors of the poses move the surface. The paper does not
    /// state a truncation.
    #[must_use]
    pub fn truncation_meters(&self, model: &Model) -> f64 {
        let distance = f64::midpoint(model.diameter(), self.max_distance_meters);
        let lever = match self.noise.wrong_pose {
            WrongPose::Object => model.radius(),
            WrongPose::Camera => distance,
        };
        let turned = self.noise.rotation_degrees.to_radians() * lever;
        // Both errors have random directions; a third of their squares is along the ray.
        let moved = self.noise.translation_meters.hypot(turned) / 3.0_f64.sqrt();
        // Open: truncation of reconstructions: §VI-B.3. Meters. It must cover what noise and wrong
        // poses move.
        3.0 * self.voxel_meters + 2.5 * self.noise.depth.sigma_meters(distance).hypot(moved)
    }

    /// Returns the reconstructed model: closed, facing outward, with the original's diameter and
    /// symmetries.
    ///
    /// Cavities and specks are dropped. Parts that noise cut off may be dropped, too: a knife's
    /// blade of 2 mm does not survive noise of 2 % of the depth.
    ///
    /// The result depends only on the configuration, the model, its name and the seed. All noise
    /// levels use the same poses and the same deviates.
    ///
    /// Cost: O(images · voxels), one or two seconds.
    ///
    /// # Errors
    ///
    /// [`SimError`] if a parameter is out of its range, if the object is too large for the
    /// distances, or if no surface is left.
    pub fn reconstruct(&self, model: &Model, object: &str, seed: u64) -> Result<Model, SimError> {
        let noise = &self.noise;
        check_range("number of images", f64::from(self.images), 1.0..=1e6)?;
        let (nearest, farthest) = (model.diameter(), self.max_distance_meters);
        if nearest >= farthest {
            return Err(SimError::TooLarge {
                object: object.to_owned(),
                diameter: nearest,
                max_distance: farthest,
            });
        }
        let automatic = || self.truncation_meters(model);
        let truncation_meters = self.truncation_meters.unwrap_or_else(automatic);
        let margin = Vector3::repeat(truncation_meters + 2.0 * self.voxel_meters);
        let half = half_extent(model);
        let mut volume = TsdfVolume::new(TsdfConfig {
            min: model.center() - half - margin,
            max: model.center() + half + margin,
            voxel_meters: self.voxel_meters,
            truncation_meters,
        })?;
        let believed = shifted(&self.camera, noise.intrinsics_pixels)?;
        for index in 0..u64::from(self.images) {
            let of = |step: &str| stream(seed, &[object, "reconstruction", step], index);
            let truth = object_pose(
                &mut of("pose"),
                &model.center(),
                nearest..farthest,
                self.axis_offset_meters,
            );
            let depth = render_depth_image(model.mesh(), &self.camera, &truth);
            let depth = noise.depth.apply(&mut of("noise"), &depth);
            let pose = noise.disturbed(&mut of("error"), &truth);
            volume.integrate(&depth, &believed, &pose)?;
        }
        let mut parts = components(&volume.surface()?)?;
        // Only parts that face outward count; a part that faces inward is the wall of a cavity.
        parts.retain(|part| part.volume > 0.0);
        // The parts are sorted by area, largest first.
        let smallest = MIN_COMPONENT_SHARE * parts.first().map_or(0.0, |largest| largest.area);
        let kept = parts.iter().filter(|part| part.area >= smallest);
        let kept = kept.map(|part| &part.mesh);
        let config = ModelConfig {
            symmetries: model.symmetries().clone(),
            // Open: diameter of reconstructions: §VI-B.3. That of the original, so that the
            // tolerances of the MVE are equal at all levels.
            diameter: Some(model.diameter()),
            ..ModelConfig::default()
        };
        Ok(Model::with_config(join(kept)?, config))
    }
}

/// Returns half the sides of the model's bounding box, meters.
fn half_extent(model: &Model) -> Vector3<f64> {
    let center = model.center();
    let vertices = model.mesh().vertices().iter();
    vertices.fold(Vector3::zeros(), |half: Vector3<f64>, p| {
        half.sup(&(p.cast::<f64>() - center).abs())
    })
}

/// Returns the camera with `pixels` added to all four parameters.
fn shifted(camera: &PinholeCamera, pixels: f64) -> Result<PinholeCamera, SimError> {
    let wrong = |_| SimError::Parameter {
        what: "error of the camera parameters in pixels",
        value: pixels,
        expected: "a finite number that leaves the focal lengths positive".to_owned(),
    };
    PinholeCamera::new(
        camera.fx() + pixels,
        camera.fy() + pixels,
        camera.cx() + pixels,
        camera.cy() + pixels,
        camera.width(),
        camera.height(),
    )
    .map_err(wrong)
}
