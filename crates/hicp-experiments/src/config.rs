//! What a study is, exactly: stored beside its rows.

use std::collections::HashSet;
use std::path::Path;

use hicp_core::PinholeCamera;
use hicp_io::ReadLimits;
use hicp_sim::{
    CaseConfig, InitialPose, MEAN_ROTATION_ERROR_DEGREES, MEAN_TRANSLATION_ERROR_METERS, VsdBins,
};
use serde::{Deserialize, Serialize};

use crate::error::ExperimentError;
use crate::experiment::Experiment;
use crate::stored::{Fields, MAX_BINS, MAX_CELLS, quoted, read_json};
use crate::subject::{Subject, fingerprint};
use crate::variant::Variant;

/// Most cases per object.
const MAX_POSES: u64 = 1_000_000;

/// The exact configuration of a study. Its rows follow from it, but for the times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Which study.
    pub experiment: Experiment,
    /// Version of this crate.
    pub version: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Cases per object.
    pub poses: u64,
    /// Whether times are measured.
    pub times: bool,
    /// Number of bins of the initial VSD, where cases are binned.
    pub bins: usize,
    /// Largest translation of a binned initial pose, metres; its rotation is 1.92° per millimetre.
    pub max_translation_m: f64,
    /// Translation of the other initial poses, metres.
    pub translation_m: f64,
    /// Rotation of the other initial poses, degrees.
    pub rotation_deg: f64,
    /// Largest distance of an object from the camera, metres; the smallest is its diameter.
    pub max_distance_m: f64,
    /// How far from the object's centre the optical axis may pass, metres.
    pub axis_offset_m: f64,
    /// The camera.
    pub camera: CameraRecord,
    /// The levels.
    pub levels: Vec<String>,
    /// The pipelines.
    pub variants: Vec<VariantRecord>,
    /// The objects.
    pub objects: Vec<ObjectRecord>,
}

/// A camera in a file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the names of every camera file")]
pub struct CameraRecord {
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    pub width: u32,
    pub height: u32,
}

/// A pipeline in a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VariantRecord {
    /// Its name.
    pub name: String,
    /// What it is made of.
    pub pipeline: String,
}

/// An object in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectRecord {
    /// Its name.
    pub name: String,
    /// `household`, or the mesh's file name.
    pub source: String,
    /// Number of triangles.
    pub triangles: usize,
    /// Diameter, millimetres.
    pub diameter_mm: f64,
    /// Whether symmetries are declared, so that ADI stands for ADD.
    pub symmetric: bool,
    /// A number that tells meshes apart.
    pub fingerprint: String,
}

impl Config {
    /// Describes a study in the paper's setting, seen by a 640 × 480 camera with a focal length of 573 pixels.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] when there are no cases, objects or variants, two have the same name, an object is too large for the
    /// distances, or a variant cannot be built.
    pub fn new(
        experiment: Experiment,
        subjects: &[Subject],
        variants: &[Variant],
        poses: u64,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        if !(1..=MAX_POSES).contains(&poses) {
            return Err(ExperimentError::Parameter {
                what: "number of cases per object",
                #[allow(clippy::cast_precision_loss)] // For a message.
                value: poses as f64,
                expected: "1 to 1000000",
            });
        }
        distinct("variant", variants.iter().map(|v| v.name.as_str()))?;
        distinct("object", subjects.iter().map(|s| s.name.as_str()))?;
        let alpha = experiment.condition(0, 0).alpha;
        for variant in variants {
            variant.build(alpha)?;
        }
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
            camera: CameraRecord {
                fx: 572.4,
                fy: 573.6,
                cx: 325.3,
                cy: 242.0,
                width: 640,
                height: 480,
            },
            levels: experiment.levels(),
            variants: variants
                .iter()
                .map(|v| VariantRecord {
                    name: v.name.clone(),
                    pipeline: v.toml.clone(),
                })
                .collect(),
            objects: subjects.iter().map(ObjectRecord::of).collect(),
        };
        for object in &config.objects {
            let diameter = object.diameter_mm / 1e3;
            if diameter >= config.max_distance_m {
                return Err(hicp_sim::SimError::TooLarge {
                    object: object.name.clone(),
                    diameter,
                    max_distance: config.max_distance_m,
                }
                .into());
            }
        }
        Ok(config)
    }

    /// Number of cases, all objects together.
    #[must_use]
    pub fn n_cases(&self) -> usize {
        let poses = usize::try_from(self.poses).unwrap_or(usize::MAX);
        poses.saturating_mul(self.objects.len())
    }

    /// Number of rows of a case.
    #[must_use]
    pub fn rows_per_case(&self) -> usize {
        self.levels.len().saturating_mul(self.variants.len())
    }

    /// The variants.
    pub(crate) fn variants(&self) -> Vec<Variant> {
        let records = self.variants.iter();
        records
            .map(|v| Variant {
                name: v.name.clone(),
                toml: v.pipeline.clone(),
            })
            .collect()
    }

    /// How cases are made, with binned initial poses or with the others.
    pub(crate) fn cases(&self, binned: bool) -> Result<CaseConfig, ExperimentError> {
        let c = &self.camera;
        let camera =
            PinholeCamera::new(c.fx, c.fy, c.cx, c.cy, c.width, c.height).map_err(|_| {
                ExperimentError::Parameter {
                    what: "focal length of the camera",
                    value: c.fx,
                    expected: "a camera whose focal lengths and size are positive",
                }
            })?;
        let init = if binned {
            InitialPose::Binned(VsdBins {
                count: self.bins,
                max_translation_meters: self.max_translation_m,
                ..VsdBins::default()
            })
        } else {
            InitialPose::Fixed {
                translation_meters: self.translation_m,
                rotation_degrees: self.rotation_deg,
            }
        };
        Ok(CaseConfig {
            max_distance_meters: self.max_distance_m,
            axis_offset_meters: self.axis_offset_m,
            ..CaseConfig::new(camera, init)
        })
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

    /// Refuses what [`Config::new`] would not have made, and what a caller cannot have changed to anything that runs; `path` is where
    /// the configuration is from, or where it would be written to.
    pub(crate) fn check(&self, path: &Path) -> Result<(), ExperimentError> {
        let fields = Fields { path };
        fields.count("poses", self.poses, 1..=MAX_POSES)?;
        fields.count("bins", self.bins as u64, 1..=MAX_BINS as u64)?;
        fields.not_negative(&[
            ("max_translation_m", self.max_translation_m),
            ("translation_m", self.translation_m),
            ("rotation_deg", self.rotation_deg),
            ("axis_offset_m", self.axis_offset_m),
        ])?;
        fields.positive(&[("max_distance_m", self.max_distance_m)])?;
        fields.camera(&self.camera)?;
        let known = self.experiment.levels();
        fields.names(
            "levels",
            known.len(),
            self.levels.iter().map(String::as_str),
        )?;
        // What a level means follows from its index; a study may have the first of them only.
        if let Some((index, level)) =
            (self.levels.iter().enumerate()).find(|(i, level)| known.get(*i) != Some(*level))
        {
            let expected = known.get(index).map_or_else(String::new, |k| quoted(k));
            let field = format!("levels[{index}]");
            let expected = format!("{expected}, as in every {} study", self.experiment);
            return Err(fields.wrong(field, quoted(level), expected));
        }
        let variants = self.variants.iter().map(|v| v.name.as_str());
        fields.names("variants", MAX_CELLS, variants)?;
        fields.objects(&self.objects)?;
        fields.cells([
            ("levels", self.levels.len()),
            ("variants", self.variants.len()),
            ("bins", self.bins),
        ])
    }
}

impl ObjectRecord {
    pub(crate) fn of(subject: &Subject) -> Self {
        let symmetries = subject.model.symmetries();
        Self {
            name: subject.name.clone(),
            source: subject.source.clone(),
            triangles: subject.model.mesh().triangles().len(),
            diameter_mm: subject.model.diameter() * 1e3,
            symmetric: !(symmetries.discrete.is_empty() && symmetries.continuous.is_empty()),
            fingerprint: format!("{:016x}", fingerprint(subject.model.mesh())),
        }
    }
}

/// Checks that there is a name and that no name comes twice.
pub(crate) fn distinct<'a>(
    what: &'static str,
    names: impl Iterator<Item = &'a str>,
) -> Result<(), ExperimentError> {
    let wrong = |name: &str, found, expected| ExperimentError::Names {
        what,
        name: name.to_owned(),
        found,
        expected,
    };
    let mut seen = HashSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(wrong(name, "is there twice", "different names"));
        }
    }
    if seen.is_empty() {
        return Err(wrong("", "is missing", "at least one"));
    }
    Ok(())
}
