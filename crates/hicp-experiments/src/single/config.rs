//! The configuration of a study of single images, stored next to its rows.

use hicp_core::{NormalWindow, PinholeCamera};
use hicp_sim::{
    CaseConfig, InitialPose, MEAN_ROTATION_ERROR_DEGREES, MEAN_TRANSLATION_ERROR_METERS, VsdBins,
};
use serde::{Deserialize, Serialize};

use super::experiment::Experiment;
use crate::error::ExperimentError;
use crate::study::{Design, Fields, ObjectRecord, camera};
use crate::subject::Subject;
use crate::variant::Variant;

/// The exact configuration of a study. It determines the rows, except for the times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The study.
    pub experiment: Experiment,
    /// Version of this crate.
    pub version: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Cases per object.
    pub poses: u64,
    /// If `true`, measures times.
    pub times: bool,
    /// Number of bins of the initial VSD, if cases are binned.
    pub bins: usize,
    /// Largest translation of a binned initial pose, meters; its rotation is 1.92° per millimeter.
    pub max_translation_m: f64,
    /// Translation of the other initial poses, meters.
    pub translation_m: f64,
    /// Rotation of the other initial poses, degrees.
    pub rotation_deg: f64,
    /// Largest distance of an object from the camera, meters; the smallest is its diameter.
    pub max_distance_m: f64,
    /// Largest distance of the optical axis from the object's center, meters.
    pub axis_offset_m: f64,
    /// Half side of the window of the normals, pixels; `null` to choose it by the noise of the
    /// image.
    #[serde(default)]
    pub normal_window: Option<u8>,
    /// The camera.
    pub camera: PinholeCamera,
    /// The levels.
    pub levels: Vec<String>,
    /// The pipelines.
    pub variants: Vec<Variant>,
    /// The objects.
    pub objects: Vec<ObjectRecord>,
}

impl Config {
    /// Creates the configuration of a study in the paper's setting.
    ///
    /// The camera has 640 × 480 pixels and a focal length of 573 pixels.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when there are no cases, objects or variants, two have the same name, an
    /// object is too large for the distances, or a variant cannot be built.
    pub fn new(
        experiment: Experiment,
        subjects: &[Subject],
        variants: &[Variant],
        poses: u64,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        let config = Self {
            experiment,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed,
            poses,
            times: true,
            bins: VsdBins::default().count,
            max_translation_m: VsdBins::default().max_translation_meters,
            translation_m: MEAN_TRANSLATION_ERROR_METERS,
            rotation_deg: MEAN_ROTATION_ERROR_DEGREES,
            max_distance_m: 0.6,
            axis_offset_m: 0.02,
            normal_window: None,
            camera: camera()?,
            levels: experiment.levels(),
            variants: variants.to_vec(),
            objects: subjects.iter().map(ObjectRecord::from).collect(),
        };
        config.check(&Fields::new(&config))?;
        let alpha = experiment.condition(0, 0).alpha;
        variants.iter().try_for_each(|v| v.build(alpha).map(drop))?;
        Ok(config)
    }

    /// Returns the window of the normals.
    pub(super) fn normals(&self) -> NormalWindow {
        self.normal_window
            .map_or(NormalWindow::Automatic, NormalWindow::HalfSide)
    }

    /// Returns the configuration of the cases, with binned or with fixed initial poses.
    pub(super) fn cases(&self, binned: bool) -> CaseConfig {
        let init = match binned {
            true => InitialPose::Binned(VsdBins {
                count: self.bins,
                max_translation_meters: self.max_translation_m,
                ..VsdBins::default()
            }),
            false => InitialPose::Fixed {
                translation_meters: self.translation_m,
                rotation_degrees: self.rotation_deg,
            },
        };
        CaseConfig {
            max_distance_meters: self.max_distance_m,
            axis_offset_meters: self.axis_offset_m,
            ..CaseConfig::new(self.camera, init)
        }
    }
}
