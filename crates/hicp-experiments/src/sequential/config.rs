//! The configuration of a sequential study, stored next to its rows.

use hicp_sim::{AxialPolynomial, Reconstruction, ReconstructionNoise, VsdBins};
use hybrid_icp::Preset;
use serde::{Deserialize, Serialize};

use super::rule::FusionRule;
use crate::error::ExperimentError;
use crate::single::TABLE_I;
use crate::study::{CameraRecord, Design, Fields, ObjectRecord};
use crate::subject::Subject;
use crate::variant::Variant;

/// The value of `experiment` in the file.
pub(super) const SEQUENTIAL: &str = "sequential";

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
    /// Largest distance of the camera's target from the object's center, meters.
    pub target_offset_m: f64,
    /// Depth noise: σ = c0 + c1 z + c2 z², meters.
    pub depth_noise_m: [f64; 3],
    /// Number of images of a reconstruction.
    pub reconstruction_images: u32,
    /// Error of every pose of a reconstruction, meters.
    pub reconstruction_translation_m: f64,
    /// Error of every pose of a reconstruction, degrees.
    pub reconstruction_rotation_deg: f64,
    /// Distance between the voxels of a reconstruction, meters.
    pub reconstruction_voxel_m: f64,
    /// Largest distance of the object from the cameras of a reconstruction, meters.
    pub reconstruction_max_distance_m: f64,
    /// The camera.
    pub camera: CameraRecord,
    /// The pipelines that compute the estimates.
    pub underlying: Vec<UnderlyingRecord>,
    /// The methods that fuse them.
    pub methods: Vec<String>,
    /// The objects.
    pub objects: Vec<ObjectRecord>,
}

/// The clock that times an estimate. It decides how far the camera moves between two images.
// Deviation: in §VI-C.1 the camera moves for as long as each estimate took. By default, a stored
// cost replaces that time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum TrajectoryClock {
    /// A stored cost per underlying pipeline, by default the mean of the paper's Table I.
    ///
    /// All methods of a pipeline see the same images, and two runs give the same bytes.
    #[default]
    Cost,
    /// The measured processor time from depth image to fused pose.
    ///
    /// Every method sees different images, and **no two runs are the same**. A fast pipeline
    /// processes thousands of images.
    Real,
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
}

impl TrajectoryConfig {
    /// Creates the paper's setting (§VI-C.1) for some underlying pipelines and all methods.
    ///
    /// The camera moves from 1 m to 0.4 m at 0.1 m/s. The depth has a D435's axial noise, the
    /// models are reconstructions with pose errors of 5 mm and 1.1°. Starts fall into ten bins.
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
        let noise = AxialPolynomial::d435_ahn2019_axial();
        let config = Self {
            experiment: SEQUENTIAL.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed,
            trajectories,
            bins: VsdBins::default().count,
            max_translation_m: VsdBins::default().max_translation_meters,
            clock: TrajectoryClock::default(),
            start_distance_m: 1.0,
            path_m: 0.6,
            speed_m_s: 0.1,
            axis_offset_m: 0.02,
            target_offset_m: 0.05,
            depth_noise_m: [noise.c0, noise.c1, noise.c2],
            reconstruction_images: 100,
            reconstruction_translation_m: 0.005,
            reconstruction_rotation_deg: 1.1,
            reconstruction_voxel_m: 0.0025,
            reconstruction_max_distance_m: 0.6,
            camera: CameraRecord::default(),
            underlying: underlying.iter().map(UnderlyingRecord::from).collect(),
            methods: FusionRule::ALL.map(FusionRule::name).to_vec(),
            objects: subjects.iter().map(ObjectRecord::from).collect(),
        };
        config.check(&Fields::new(&config))?;
        Ok(config)
    }

    /// Returns how far the camera moves between the images of an underlying pipeline, meters.
    #[must_use]
    pub fn step_m(&self, underlying: usize) -> f64 {
        self.speed_m_s * self.underlying[underlying].seconds_per_estimate
    }

    /// Returns the number of images along a trajectory of an underlying pipeline.
    #[must_use]
    pub fn n_images(&self, underlying: usize) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // The count is small and not negative. The addend keeps the last image of a path of whole
        // steps in spite of rounding.
        let steps = (self.path_m / self.step_m(underlying) + 1e-9)
            .max(0.0)
            .floor() as usize;
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

    pub(super) fn depth_noise(&self) -> AxialPolynomial {
        let [c0, c1, c2] = self.depth_noise_m;
        AxialPolynomial { c0, c1, c2 }
    }

    pub(super) fn reconstruction(&self) -> Result<Reconstruction, ExperimentError> {
        let noise = ReconstructionNoise {
            translation_meters: self.reconstruction_translation_m,
            rotation_degrees: self.reconstruction_rotation_deg,
            ..ReconstructionNoise::default()
        };
        Ok(Reconstruction {
            images: self.reconstruction_images,
            max_distance_meters: self.reconstruction_max_distance_m,
            axis_offset_meters: self.axis_offset_m,
            voxel_meters: self.reconstruction_voxel_m,
            ..Reconstruction::new(self.camera.pinhole()?, noise)
        })
    }
}

impl From<&Preset> for UnderlyingRecord {
    /// Creates the record of a preset, with its cost in the paper's Table I.
    ///
    /// A preset beyond the paper costs 0.5 s.
    fn from(preset: &Preset) -> Self {
        let cost = TABLE_I.iter().find(|(name, ..)| *name == preset.name());
        Self {
            name: preset.name().to_owned(),
            pipeline: preset.toml().to_owned(),
            seconds_per_estimate: cost.map_or(0.5, |(_, mean, _)| *mean),
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
