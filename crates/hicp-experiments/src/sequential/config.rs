//! What a sequential study is, exactly: stored beside its rows.

use std::path::Path;

use hicp_core::PinholeCamera;
use hicp_io::ReadLimits;
use hicp_sim::{AxialPolynomial, Reconstruction, ReconstructionNoise, SimError, VsdBins};
use hybrid_icp::Preset;
use serde::{Deserialize, Serialize};

use super::rule::FusionRule;
use crate::claims::TABLE_I;
use crate::config::{CameraRecord, ObjectRecord, distinct};
use crate::error::ExperimentError;
use crate::stored::{Fields, MAX_BINS, quoted, read_json};
use crate::subject::Subject;
use crate::variant::Variant;

/// What `experiment` says in the file.
const SEQUENTIAL: &str = "sequential";
/// Most trajectories per object and bin.
const MAX_TRAJECTORIES: u64 = 100_000;
/// Most underlying pipelines: each has a panel of the figure.
const MAX_UNDERLYING: usize = 40;
/// Most methods.
const MAX_METHODS: usize = 100;

/// The exact configuration of a sequential study. Its rows follow from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrajectoryConfig {
    /// Always `sequential`.
    pub experiment: String,
    /// Version of this crate.
    pub version: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Trajectories per object and bin.
    pub trajectories: u64,
    /// Number of bins of the initial VSD.
    pub bins: usize,
    /// Largest translation of an initial pose, metres; its rotation is 1.92° per millimetre.
    pub max_translation_m: f64,
    /// What says how far the camera moves on from one image to the next.
    #[serde(default)]
    pub clock: TrajectoryClock,
    /// Distance of the object's centre along the optical axis in the first image, metres.
    pub start_distance_m: f64,
    /// How far the camera travels, metres.
    pub path_m: f64,
    /// Its speed, metres per second.
    pub speed_m_s: f64,
    /// How far from the object's centre the first optical axis may pass, metres.
    pub axis_offset_m: f64,
    /// How far from the object's centre the point may be that the camera moves toward, metres.
    pub target_offset_m: f64,
    /// Depth noise: σ = c0 + c1 z + c2 z², metres.
    pub depth_noise_m: [f64; 3],
    /// Number of images of a reconstruction.
    pub reconstruction_images: u32,
    /// Error of every pose of a reconstruction, metres.
    pub reconstruction_translation_m: f64,
    /// Error of every pose of a reconstruction, degrees.
    pub reconstruction_rotation_deg: f64,
    /// Distance between the voxels of a reconstruction, metres.
    pub reconstruction_voxel_m: f64,
    /// Largest distance of the object from the cameras of a reconstruction, metres.
    pub reconstruction_max_distance_m: f64,
    /// The camera.
    pub camera: CameraRecord,
    /// The pipelines that make the estimates.
    pub underlying: Vec<UnderlyingRecord>,
    /// The methods that fuse them.
    pub methods: Vec<String>,
    /// The objects.
    pub objects: Vec<ObjectRecord>,
}

/// What time an estimate takes, and with it how far the camera moves on meanwhile.
// Deviation: in §VI-C.1 the camera moves on by the time that each estimate took; by default a stored cost stands for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum TrajectoryClock {
    /// A stored cost: an estimate of an underlying pipeline takes the same time whatever the image and the method, by default what
    /// the paper's Table I measured on average. All methods of a pipeline see the same images, and the same bytes come out.
    #[default]
    Cost,
    /// The processor time from depth image to fused pose, as it was. Every method sees images of its own, and **no two runs are the
    /// same**; a fast pipeline takes thousands of images.
    Real,
}

/// An underlying pipeline in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnderlyingRecord {
    /// Its name.
    pub name: String,
    /// What it is made of.
    pub pipeline: String,
    /// What an estimate costs, seconds: the cost model.
    pub seconds_per_estimate: f64,
}

impl TrajectoryConfig {
    /// Describes the paper's setting (§VI-C.1) for some underlying pipelines and all methods: from 1 m to 0.4 m at 0.1 m/s, a D435's
    /// axial noise, reconstructions with 5 mm and 1.1°, ten bins.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when there are no trajectories, objects or pipelines, two have the same name, or an object is larger than
    /// the distance that the camera ends at.
    pub fn new(
        subjects: &[Subject],
        underlying: &[Preset],
        trajectories: u64,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        if !(1..=MAX_TRAJECTORIES).contains(&trajectories) {
            return Err(ExperimentError::Parameter {
                what: "number of trajectories per object and bin",
                #[allow(clippy::cast_precision_loss)] // For a message.
                value: trajectories as f64,
                expected: "1 to 100000",
            });
        }
        distinct("underlying pipeline", underlying.iter().map(|u| u.name()))?;
        distinct("object", subjects.iter().map(|s| s.name.as_str()))?;
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
            camera: CameraRecord {
                fx: 572.4,
                fy: 573.6,
                cx: 325.3,
                cy: 242.0,
                width: 640,
                height: 480,
            },
            underlying: underlying.iter().map(|u| record(*u)).collect(),
            methods: FusionRule::ALL.map(FusionRule::name).to_vec(),
            objects: subjects.iter().map(ObjectRecord::of).collect(),
        };
        let end = config.start_distance_m - config.path_m;
        for object in &config.objects {
            let diameter = object.diameter_mm / 1e3;
            if diameter >= end {
                return Err(SimError::TooLarge {
                    object: object.name.clone(),
                    diameter,
                    max_distance: end,
                }
                .into());
            }
        }
        Ok(config)
    }

    /// Number of trajectories, all objects and bins together.
    #[must_use]
    pub fn n_trajectories(&self) -> usize {
        let per_bin = usize::try_from(self.trajectories).unwrap_or(usize::MAX);
        per_bin
            .saturating_mul(self.bins)
            .saturating_mul(self.objects.len())
    }

    /// Number of rows of a trajectory.
    #[must_use]
    pub fn rows_per_trajectory(&self) -> usize {
        self.underlying.len().saturating_mul(self.methods.len())
    }

    /// How far the camera moves between the images of an underlying pipeline, metres.
    #[must_use]
    pub fn step_m(&self, underlying: usize) -> f64 {
        self.speed_m_s * self.underlying[underlying].seconds_per_estimate
    }

    /// Number of images along a trajectory of an underlying pipeline.
    #[must_use]
    pub fn n_images(&self, underlying: usize) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // Not negative, and small; a path of whole steps ends with an image in spite of rounding.
        let steps = (self.path_m / self.step_m(underlying) + 1e-9)
            .max(0.0)
            .floor() as usize;
        steps.min(100_000) + 1
    }

    pub(crate) fn pinhole(&self) -> Result<PinholeCamera, ExperimentError> {
        let c = &self.camera;
        PinholeCamera::new(c.fx, c.fy, c.cx, c.cy, c.width, c.height).map_err(|_| {
            ExperimentError::Parameter {
                what: "focal length of the camera",
                value: c.fx,
                expected: "a camera whose focal lengths and size are positive",
            }
        })
    }

    pub(crate) fn depth_noise(&self) -> AxialPolynomial {
        let [c0, c1, c2] = self.depth_noise_m;
        AxialPolynomial { c0, c1, c2 }
    }

    pub(crate) fn reconstruction(&self) -> Result<Reconstruction, ExperimentError> {
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
            ..Reconstruction::new(self.pinhole()?, noise)
        })
    }

    /// The underlying pipelines, to build from.
    pub(crate) fn variants(&self) -> Vec<Variant> {
        let records = self.underlying.iter();
        records
            .map(|u| Variant {
                name: u.name.clone(),
                toml: u.pipeline.clone(),
            })
            .collect()
    }

    /// The text of the file.
    pub(crate) fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Reads a file.
    pub(crate) fn read(limits: &ReadLimits, path: &Path) -> Result<Self, ExperimentError> {
        let config: Self = read_json(limits, path)?;
        config.check(path)?;
        Ok(config)
    }

    /// Refuses what [`TrajectoryConfig::new`] would not have made, and what a caller cannot have changed to anything that runs; `path` is
    /// where the configuration is from, or where it would be written to.
    pub(crate) fn check(&self, path: &Path) -> Result<(), ExperimentError> {
        let fields = Fields { path };
        if self.experiment != SEQUENTIAL {
            let expected = quoted(SEQUENTIAL);
            return Err(fields.wrong("experiment", quoted(&self.experiment), expected));
        }
        fields.count("trajectories", self.trajectories, 1..=MAX_TRAJECTORIES)?;
        fields.count("bins", self.bins as u64, 1..=MAX_BINS as u64)?;
        fields.not_negative(&[
            ("max_translation_m", self.max_translation_m),
            ("path_m", self.path_m),
            ("axis_offset_m", self.axis_offset_m),
            ("target_offset_m", self.target_offset_m),
            (
                "reconstruction_translation_m",
                self.reconstruction_translation_m,
            ),
            (
                "reconstruction_rotation_deg",
                self.reconstruction_rotation_deg,
            ),
        ])?;
        fields.positive(&[
            ("start_distance_m", self.start_distance_m),
            ("speed_m_s", self.speed_m_s),
            ("reconstruction_voxel_m", self.reconstruction_voxel_m),
            (
                "reconstruction_max_distance_m",
                self.reconstruction_max_distance_m,
            ),
        ])?;
        fields.camera(&self.camera)?;
        let underlying = self.underlying.iter().map(|u| u.name.as_str());
        fields.names("underlying", MAX_UNDERLYING, underlying)?;
        for (index, underlying) in self.underlying.iter().enumerate() {
            let field = format!("underlying[{index}].seconds_per_estimate");
            fields.positive(&[(&field, underlying.seconds_per_estimate)])?;
        }
        let methods = self.methods.iter().map(String::as_str);
        fields.names("methods", MAX_METHODS, methods)?;
        for (index, method) in self.methods.iter().enumerate() {
            if FusionRule::from_name(method).is_none() {
                let field = format!("methods[{index}]");
                return Err(fields.wrong(field, quoted(method), FusionRule::EXPECTED));
            }
        }
        fields.objects(&self.objects)?;
        fields.cells([
            ("underlying", self.underlying.len()),
            ("methods", self.methods.len()),
            ("bins", self.bins),
        ])
    }
}

/// A preset with what the paper's Table I says that it costs; every preset of the paper is there.
fn record(preset: Preset) -> UnderlyingRecord {
    let cost = TABLE_I.iter().find(|(name, ..)| *name == preset.name());
    UnderlyingRecord {
        name: preset.name().to_owned(),
        pipeline: preset.toml().to_owned(),
        seconds_per_estimate: cost.map_or(0.5, |(_, mean, _)| *mean),
    }
}
