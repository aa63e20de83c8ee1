//! Cases of the single-image studies: an object, its true pose, an image, and an initial pose.

use hicp_core::{
    Context, DepthImage, Isometry3, Mask, Model, Observation, PinholeCamera, Problem, RenderCache,
};
use hicp_raster::{Rasterizer, render_depth_image};
use hicp_score::{Score, Vsd};
use rand::RngExt;

use crate::SimRng;
use crate::error::{SimError, check_range};
use crate::sampling::{
    DEGREES_PER_MILLIMETER, MEAN_ROTATION_ERROR_DEGREES, MEAN_TRANSLATION_ERROR_METERS,
    object_pose, perturb,
};
use crate::stream::stream;

/// The rule by which initial poses deviate from the true pose (§VI-A.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InitialPose {
    /// A fixed deviation in random directions (§VI-B.2 and §VI-B.3).
    Fixed {
        /// Translation error, meters.
        translation_meters: f64,
        /// Rotation error, degrees.
        rotation_degrees: f64,
    },
    /// Random deviations, drawn so that the initial VSD falls into the bin of the case (§VI-B.1).
    ///
    /// With ten bins, every tenth case has the same bin.
    Binned(VsdBins),
}

impl InitialPose {
    /// Returns the mean error of a sampling-based pose estimator: 6.2 mm and 9.5° (§VI-A.5).
    #[must_use]
    pub fn mean_error() -> Self {
        Self::Fixed {
            translation_meters: MEAN_TRANSLATION_ERROR_METERS,
            rotation_degrees: MEAN_ROTATION_ERROR_DEGREES,
        }
    }
}

/// Rejection sampling to equal counts in equally wide bins of the initial VSD (§VI-B.1).
///
/// δ_t is uniform in [0, `max_translation_meters`]. δ_θ is 1.92° per millimeter of δ_t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VsdBins {
    /// Number of bins over [0, 1]; the last one holds 1.
    pub count: usize,
    /// Largest translation error, meters.
    pub max_translation_meters: f64,
    /// Number of initial poses tried around one object pose before another object pose is drawn.
    pub tries_per_pose: u32,
    /// Number of object poses tried before the bin counts as impossible to fill.
    pub max_poses: u32,
}

impl Default for VsdBins {
    /// Returns ten bins and 0.15 m, as in the paper, with 500 tries around each of at most 40
    /// poses.
    fn default() -> Self {
        Self {
            count: 10,
            max_translation_meters: 0.15,
            // Open: rejection sampling: §VI-B.1. Initial poses tried around one object pose.
            // Drawing both for every try would favor object poses for which the bin is easy to hit.
            tries_per_pose: 500,
            // Open: end of rejection sampling: §VI-B.1. Object poses tried before a bin counts as
            // impossible to fill.
            max_poses: 40,
        }
    }
}

/// The configuration for the generation of cases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CaseConfig {
    /// The camera.
    pub camera: PinholeCamera,
    /// Largest distance of the object's center along the optical axis, meters.
    ///
    /// The smallest distance is the object's diameter (§VI-A.3).
    pub max_distance_meters: f64,
    /// Largest distance between the object's center and the optical axis, meters.
    pub axis_offset_meters: f64,
    /// The rule for initial poses.
    pub init: InitialPose,
}

impl CaseConfig {
    /// Returns the single-image setting of the paper: distances up to 0.6 m.
    ///
    /// The axis passes within 0.02 m of the center, which the paper calls "in the proximity".
    #[must_use]
    pub fn new(camera: PinholeCamera, init: InitialPose) -> Self {
        Self {
            camera,
            max_distance_meters: 0.6,
            // Open: point in the proximity of the object's center: §VI-A.3. Uniform in a disc of
            // this radius, meters, in which the optical axis passes.
            axis_offset_meters: 0.02,
            init,
        }
    }

    fn draw_pose(&self, model: &Model, rng: &mut SimRng) -> Isometry3<f64> {
        let distances = model.diameter()..self.max_distance_meters;
        object_pose(rng, &model.center(), distances, self.axis_offset_meters)
    }
}

/// A perfect image of one object, and a pose to refine. All variants of a study get the same case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of the object. It contributes to the seed of the random numbers.
    pub object: String,
    /// Seed of the study.
    pub seed: u64,
    /// Index of the case among the cases of its object.
    pub index: u64,
    /// The camera.
    pub camera: PinholeCamera,
    /// The true pose, meters.
    pub camera_from_object: Isometry3<f64>,
    /// The initial pose, meters.
    pub init: Isometry3<f64>,
    /// The bin of `vsd_initial`, from 0, if there are bins.
    pub bin: Option<usize>,
    /// Mean VSD of `init` against the truth (§VI-A.2).
    pub vsd_initial: f64,
    /// Number of initial poses that were drawn to get this one.
    pub tries: u32,
    /// The rendered depth, without noise and without other objects, meters.
    pub depth: DepthImage,
    /// The pixels at which the object is visible.
    pub mask: Mask,
}

/// Generates cases and keeps the renderer's memory between them. Use one per thread.
///
/// A case depends only on the configuration, the model, its name, the seed and the index. The order
/// of generation and the number of threads do not change it.
///
/// Cost: one render per tried initial pose ([`Case::tries`]), one per tried object pose, and one
/// for the whole image.
///
/// ```
/// use hicp_core::PinholeCamera;
/// use hicp_sim::{CaseConfig, CaseMaker, Corruption, Household, InitialPose, VsdBins};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let camera = PinholeCamera::new(143.0, 143.0, 79.5, 59.5, 160, 120)?;
/// let config = CaseConfig::new(camera, InitialPose::Binned(VsdBins::default()));
/// let mug = Household::Mug.model()?;
/// let case = CaseMaker::new(config)?.case(&mug, "mug", 1, 13)?;
/// assert_eq!(case.bin, Some(3)); // case 13 of ten bins
/// assert!((0.3..0.4).contains(&case.vsd_initial));
/// let observation = Corruption::default().observe(&case)?;
/// assert_eq!(observation.depth(), &case.depth);
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct CaseMaker {
    config: CaseConfig,
    renders: RenderCache,
    /// Scores read only the camera of the observation, so this one has no depth.
    nothing: Observation,
}

impl CaseMaker {
    /// Creates a generator of cases.
    ///
    /// # Errors
    ///
    /// [`SimError::Parameter`] if a length, an angle or a count of the configuration is out of its
    /// range.
    pub fn new(config: CaseConfig) -> Result<Self, SimError> {
        let length = |what, value| check_range(what, value, 0.0..=100.0);
        length("largest distance in meters", config.max_distance_meters)?;
        length("axis offset in meters", config.axis_offset_meters)?;
        match config.init {
            InitialPose::Fixed {
                translation_meters,
                rotation_degrees,
            } => {
                length("translation error in meters", translation_meters)?;
                check_range("rotation error in degrees", rotation_degrees, 0.0..=180.0)?;
            }
            InitialPose::Binned(bins) => {
                let largest = bins.max_translation_meters;
                length("largest translation error in meters", largest)?;
                for (what, count) in [
                    ("number of VSD bins", bins.count as f64),
                    ("tries per object pose", f64::from(bins.tries_per_pose)),
                    ("number of object poses tried", f64::from(bins.max_poses)),
                ] {
                    check_range(what, count, 1.0..=1e9)?;
                }
            }
        }
        let (width, height) = (config.camera.width(), config.camera.height());
        let area = config.camera.region().area();
        let nothing = DepthImage::from_meters(width, height, vec![0.0; area])?;
        let unmasked = Mask::new(width, height, vec![false; area])?;
        Ok(Self {
            config,
            renders: RenderCache::new(Rasterizer::default()),
            nothing: Observation::new(nothing, unmasked, config.camera)?,
        })
    }

    /// Generates a case. With bins, case i has bin i modulo the number of bins.
    ///
    /// The object pose of a case is the same for every [`InitialPose`], unless all tries around it
    /// missed the bin.
    ///
    /// # Errors
    ///
    /// [`SimError::TooLarge`] if the object's diameter leaves no distance to draw.
    /// [`SimError::UnfilledBin`] if no initial pose falls into the bin.
    pub fn case(
        &mut self,
        model: &Model,
        object: &str,
        seed: u64,
        index: u64,
    ) -> Result<Case, SimError> {
        if model.diameter() >= self.config.max_distance_meters {
            return Err(SimError::TooLarge {
                object: object.to_owned(),
                diameter: model.diameter(),
                max_distance: self.config.max_distance_meters,
            });
        }
        let mut poses = stream(seed, &[object, "pose"], index);
        let mut inits = stream(seed, &[object, "init"], index);
        let (start, bin) = match self.config.init {
            InitialPose::Fixed {
                translation_meters,
                rotation_degrees,
            } => {
                let truth = self.config.draw_pose(model, &mut poses);
                let angle = rotation_degrees.to_radians();
                let init = perturb(&mut inits, &truth, translation_meters, angle);
                let vsd = self.vsd(model, &truth, &init);
                let start = Start {
                    truth,
                    init,
                    vsd,
                    tries: 1,
                };
                (start, None)
            }
            InitialPose::Binned(bins) => {
                #[allow(clippy::cast_possible_truncation)]
                // Below the number of bins.
                let bin = (index % bins.count as u64) as usize;
                let config = self.config;
                let draw = || config.draw_pose(model, &mut poses);
                let found = self.start_in_bin(model, &bins, bin, &mut inits, draw);
                let start = found.ok_or_else(|| SimError::UnfilledBin {
                    object: object.to_owned(),
                    index,
                    bin,
                    bins: bins.count,
                    low: bin as f64 / bins.count as f64,
                    high: (bin + 1) as f64 / bins.count as f64,
                    tried: bins.max_poses.saturating_mul(bins.tries_per_pose),
                    poses: bins.max_poses,
                })?;
                (start, Some(bin))
            }
        };
        let camera = self.config.camera;
        let depth = render_depth_image(model.mesh(), &camera, &start.truth);
        Ok(Case {
            object: object.to_owned(),
            seed,
            index,
            camera,
            camera_from_object: start.truth,
            init: start.init,
            bin,
            vsd_initial: start.vsd,
            tries: start.tries,
            mask: Mask::measured(&depth),
            depth,
        })
    }

    /// Draws initial poses, and occasionally another object pose, until one falls into the bin.
    ///
    /// `draw` draws the object poses. Drawing both for every try would favor object poses for which
    /// the bin is easy to hit. If no try of [`VsdBins`] falls into the bin, returns `None`.
    pub fn start_in_bin(
        &mut self,
        model: &Model,
        bins: &VsdBins,
        bin: usize,
        inits: &mut SimRng,
        mut draw: impl FnMut() -> Isometry3<f64>,
    ) -> Option<Start> {
        let mut tries = 0;
        for _ in 0..bins.max_poses {
            let truth = draw();
            for _ in 0..bins.tries_per_pose {
                tries += 1;
                let translation = bins.max_translation_meters * inits.random::<f64>();
                let init = perturb(inits, &truth, translation, rotation_of(translation));
                let vsd = self.vsd(model, &truth, &init);
                if bins.bin_of(vsd) == bin {
                    return Some(Start {
                        truth,
                        init,
                        vsd,
                        tries,
                    });
                }
            }
        }
        None
    }

    /// Returns the mean VSD of a pose, with both poses rendered in the configured camera (§VI-A.2).
    pub fn vsd(
        &mut self,
        model: &Model,
        truth: &Isometry3<f64>,
        camera_from_object: &Isometry3<f64>,
    ) -> f64 {
        let problem = Problem::new(model, &self.nothing);
        let mut context = Context::new(problem, &mut self.renders);
        Vsd::new(*truth).score(&mut context, camera_from_object)
    }
}

/// A true pose and an initial pose that fall into a bin of VSD.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// The true pose, camera from object.
    pub truth: Isometry3<f64>,
    /// The initial pose, camera from object.
    pub init: Isometry3<f64>,
    /// Mean VSD of the initial pose against the true one.
    pub vsd: f64,
    /// Number of initial poses that were tried.
    pub tries: u32,
}

impl VsdBins {
    /// Returns the bin of a VSD in [0, 1], from 0.
    #[must_use]
    pub fn bin_of(&self, vsd: f64) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // Not negative, and cut to the last bin.
        let bin = (vsd * self.count as f64) as usize;
        bin.min(self.count.saturating_sub(1))
    }
}

/// Returns the rotation error in radians for a translation error in meters (§VI-A.5).
///
/// The ratio is 1.92° per millimeter.
#[must_use]
pub fn rotation_of(translation_meters: f64) -> f64 {
    // Open: rotations above 180°: §VI-B.1. A translation error of 0.15 m comes with 288°, which
    // acts like −72°. The text states no limit, so there is none.
    (translation_meters * 1e3 * DEGREES_PER_MILLIMETER).to_radians()
}
