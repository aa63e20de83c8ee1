//! The configuration of a sequential study, stored next to its rows.

use hicp_core::PinholeCamera;
use hicp_sim::{DepthNoise, Reconstruction, ReconstructionNoise, VsdBins, WrongPose};
use hybrid_icp::{Preset, WithoutPairs};
use serde::{Deserialize, Serialize};

use super::rule::{FusionRule, PlainCovariance};
use crate::error::ExperimentError;
use crate::single::TABLE_I;
use crate::study::{Design, Fields, ObjectRecord, camera};
use crate::subject::Subject;
use crate::variant::Variant;

/// The value of `experiment` in the file.
pub(super) const SEQUENTIAL: &str = "sequential";
/// Time of an MVE as a share of the time of `hybrid`, and of a projective pipeline.
// Open: time of an MVE: §VI-C.1. The paper counts it for methods that need it and does not state
// it. Here it is the share that it takes of an estimate
// (`cargo run --release -p hicp-benches --example breakdown`).
const MVE_SHARE: [f64; 2] = [0.07, 0.17];

/// The exact configuration of a sequential study. It determines the rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrajectoryConfig {
    /// Always `sequential`.
    pub experiment: String,
    /// Version of this crate.
    pub version: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Trajectories per object and bin.
    pub trajectories: u64,
    /// Number of bins of the initial VSD.
    pub bins: usize,
    /// Largest translation of an initial pose, meters; its rotation is 1.92° per millimeter.
    pub max_translation_m: f64,
    /// The clock, which decides how far the camera moves between two images.
    #[serde(default)]
    pub clock: TrajectoryClock,
    /// Distance of the object's center along the optical axis in the first image, meters.
    pub start_distance_m: f64,
    /// Length of the path of the camera, meters.
    pub path_m: f64,
    /// Speed of the camera, meters per second.
    pub speed_m_s: f64,
    /// Largest distance of the first optical axis from the object's center, meters.
    pub axis_offset_m: f64,
    /// The direction in which the camera moves.
    pub path: PathDirection,
    /// Noise of the depth images, as [`DepthNoise`] writes it.
    pub depth_noise: String,
    /// The covariances that the paper's methods fuse.
    pub covariance: PlainCovariance,
    /// The pose that the paper's methods fuse if ICP finds no pairs.
    pub without_pairs: WithoutPairs,
    /// Number of images of a reconstruction.
    pub reconstruction_images: u32,
    /// Noise of the images of a reconstruction.
    pub reconstruction_depth_noise: String,
    /// The pose that is wrong in every image of a reconstruction.
    #[serde(with = "WrongPoseRecord")]
    pub reconstruction_wrong_pose: WrongPose,
    /// Error of that pose, meters.
    pub reconstruction_translation_m: f64,
    /// Error of that pose, degrees.
    pub reconstruction_rotation_deg: f64,
    /// Distance between the voxels of a reconstruction, meters.
    pub reconstruction_voxel_m: f64,
    /// Truncation of a reconstruction's volume, meters; `null` to choose it by the noise and the
    /// errors of the poses.
    pub reconstruction_truncation_m: Option<f64>,
    /// Largest distance of the object from the cameras of a reconstruction, meters.
    pub reconstruction_max_distance_m: f64,
    /// The camera.
    pub camera: PinholeCamera,
    /// The pipelines that compute the estimates.
    pub underlying: Vec<UnderlyingRecord>,
    /// The methods that fuse them.
    pub methods: Vec<String>,
    /// The objects.
    pub objects: Vec<ObjectRecord>,
}

/// The clock that times an estimate. It decides how far the camera moves between two images.
// Deviation: clock: §VI-C.1 moves the camera for as long as each estimate took.
// Here the mean of Table I replaces that time, and methods that need an MVE take its share of an
// estimate more, so that a study can be repeated. `--clock real` measures it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum TrajectoryClock {
    /// A stored cost per underlying pipeline, by default the mean of the paper's Table I.
    ///
    /// Methods of a pipeline whose estimates take equally long see the same images. Two runs give
    /// the same bytes.
    #[default]
    Cost,
    /// The measured processor time from depth image to fused pose.
    ///
    /// Every method sees different images, and **no two runs are the same**. A fast pipeline
    /// processes thousands of images.
    Real,
}

/// The direction in which the camera moves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum PathDirection {
    /// Along its optical axis (§VI-C.1).
    OpticalAxis,
    /// Toward a random point near the object's center.
    Target {
        /// Largest distance of that point from the center, meters.
        offset_m: f64,
    },
}

/// [`WrongPose`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(remote = "WrongPose", rename_all = "kebab-case")]
enum WrongPoseRecord {
    Object,
    Camera,
}

/// An underlying pipeline in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnderlyingRecord {
    /// Its name.
    pub name: String,
    /// Its TOML text.
    pub pipeline: String,
    /// The cost of an estimate, seconds.
    pub seconds_per_estimate: f64,
    /// The cost of its MVE, for methods that need it, seconds.
    pub seconds_per_mve: f64,
}

impl TrajectoryConfig {
    /// Creates the study as the paper describes it (§VI-C), for some underlying pipelines and all
    /// methods.
    ///
    /// The camera moves along its optical axis from 1 m to 0.4 m at 0.1 m/s. The depth has a D435's
    /// axial noise. The models are reconstructions from images with the same noise and with camera
    /// poses that are off by 5 mm and 1.1°. Starts fall into ten bins. Covariances are e_MVE·I₆,
    /// and methods that need an MVE see fewer images.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when there are no trajectories, objects or pipelines, two have the same
    /// name, or an object is larger than the distance at which the path ends.
    pub fn new(
        subjects: &[Subject],
        underlying: &[Preset],
        trajectories: u64,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        let noise = DepthNoise::D435_AHN2019_AXIAL.to_string();
        let config = Self {
            experiment: SEQUENTIAL.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed,
            trajectories,
            bins: VsdBins::default().count,
            max_translation_m: VsdBins::default().max_translation_meters,
            clock: TrajectoryClock::default(),
            start_distance_m: 1.0,
            // Open: length of the path: §VI-C.1. Meters. It ends where the object is as near as in
            // the images of §VI-A.3.
            path_m: 0.6,
            speed_m_s: 0.1,
            axis_offset_m: 0.02,
            path: PathDirection::OpticalAxis,
            depth_noise: noise.clone(),
            covariance: PlainCovariance::Identity,
            without_pairs: WithoutPairs::Initial,
            reconstruction_images: 100,
            reconstruction_depth_noise: noise,
            reconstruction_wrong_pose: WrongPose::Camera,
            reconstruction_translation_m: 0.005,
            reconstruction_rotation_deg: 1.1,
            reconstruction_voxel_m: 0.0025,
            reconstruction_truncation_m: None,
            reconstruction_max_distance_m: 0.6,
            camera: camera()?,
            underlying: underlying.iter().map(UnderlyingRecord::from).collect(),
            methods: FusionRule::ALL.map(FusionRule::name).to_vec(),
            objects: subjects.iter().map(ObjectRecord::from).collect(),
        };
        config.check(&Fields::new(&config))?;
        Ok(config)
    }

    /// Returns the improved protocol, which differs from the paper's.
    ///
    /// - Covariances are e_MVE·U around the object's center, and nothing is fused if ICP finds no
    ///   pairs.
    /// - All methods of a pipeline see the same images.
    /// - The images of the reconstructions have no noise, and the object's poses in them are off.
    /// - The camera moves toward a point within 5 cm of the object's center.
    #[must_use]
    pub fn improved(mut self) -> Self {
        // Deviation: direction of the path: §VI-C.1 moves the camera along its optical axis.
        // `--protocol improved` moves it toward a random point near the object's center, so that
        // the object leaves the middle of the image. The default is the paper's.
        self.path = PathDirection::Target { offset_m: 0.05 };
        self.covariance = PlainCovariance::AboutObject;
        self.without_pairs = WithoutPairs::Nothing;
        self.reconstruction_depth_noise = DepthNoise::None.to_string();
        self.reconstruction_wrong_pose = WrongPose::Object;
        for underlying in &mut self.underlying {
            underlying.seconds_per_mve = 0.0;
        }
        self
    }

    /// Returns the time of an estimate of an underlying pipeline, with or without an MVE, seconds.
    #[must_use]
    pub fn seconds(&self, underlying: usize, with_mve: bool) -> f64 {
        let it = &self.underlying[underlying];
        it.seconds_per_estimate + if with_mve { it.seconds_per_mve } else { 0.0 }
    }

    /// Returns the number of images along a trajectory, with or without an MVE for each.
    #[must_use]
    pub fn n_images(&self, underlying: usize, with_mve: bool) -> usize {
        let step_m = self.speed_m_s * self.seconds(underlying, with_mve);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // The count is small and not negative. The addend keeps the last image of a path of whole
        // steps in spite of rounding.
        let steps = (self.path_m / step_m + 1e-9).max(0.0).floor() as usize;
        steps.min(100_000) + 1
    }

    /// Returns the name of a pipeline with a method in an analysis.
    pub(super) fn variant(underlying: &str, method: &str) -> String {
        format!("{underlying}/{method}")
    }

    /// Returns the methods of the paper.
    pub(super) fn paper_methods(&self) -> Vec<&str> {
        let is_of_paper = |m: &&str| FusionRule::from_name(m).is_some_and(FusionRule::is_of_paper);
        self.methods
            .iter()
            .map(String::as_str)
            .filter(is_of_paper)
            .collect()
    }

    /// Returns a noise that was checked with the configuration.
    pub(super) fn noise(text: &str) -> DepthNoise {
        text.parse().unwrap_or_default()
    }

    pub(super) fn reconstruction(&self) -> Reconstruction {
        let noise = ReconstructionNoise {
            depth: Self::noise(&self.reconstruction_depth_noise),
            translation_meters: self.reconstruction_translation_m,
            rotation_degrees: self.reconstruction_rotation_deg,
            wrong_pose: self.reconstruction_wrong_pose,
            ..ReconstructionNoise::default()
        };
        Reconstruction {
            images: self.reconstruction_images,
            max_distance_meters: self.reconstruction_max_distance_m,
            axis_offset_meters: self.axis_offset_m,
            voxel_meters: self.reconstruction_voxel_m,
            truncation_meters: self.reconstruction_truncation_m,
            ..Reconstruction::new(self.camera, noise)
        }
    }
}

impl From<&Preset> for UnderlyingRecord {
    /// Creates the record of a preset, with its cost in the paper's Table I.
    ///
    /// A preset beyond the paper costs 0.5 s. The MVE costs the share of an estimate that it costs
    /// here.
    fn from(preset: &Preset) -> Self {
        let cost = TABLE_I.iter().find(|(name, ..)| *name == preset.name());
        let seconds = cost.map_or(0.5, |(_, mean, _)| *mean);
        let is_projective = preset.name().starts_with("projective-");
        let share = MVE_SHARE[usize::from(is_projective)];
        Self {
            name: preset.name().to_owned(),
            pipeline: preset.toml().to_owned(),
            seconds_per_estimate: seconds,
            seconds_per_mve: share * seconds,
        }
    }
}

impl UnderlyingRecord {
    /// Returns the pipeline, ready to be built.
    pub(super) fn variant(&self) -> Variant {
        Variant {
            name: self.name.clone(),
            toml: self.pipeline.clone(),
        }
    }
}
