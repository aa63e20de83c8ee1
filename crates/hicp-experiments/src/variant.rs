//! The pipelines of a study.

use std::path::Path;

use hybrid_icp::pipeline::{PipelineFile, PipelineLimits};
use hybrid_icp::{BoxedStage, Preset};
use serde::{Deserialize, Serialize};

use crate::error::ExperimentError;

/// The path of the threshold α in a switch, and in a repeated one such as [`Preset::Hybrid`].
const ALPHA_FIELD: &str = "switcher.alpha";

/// A named pipeline: a preset, or a file, built from the parts that ship.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Name in tables.
    pub name: String,
    /// The text of its pipeline file; `pipeline` in a configuration.
    #[serde(rename = "pipeline")]
    pub toml: String,
}

impl Variant {
    /// Returns the nine variants of the paper, Hybrid ICP first.
    #[must_use]
    pub fn paper() -> Vec<Self> {
        Preset::PAPER.into_iter().map(Self::preset).collect()
    }

    /// Returns the variants of [`crate::Experiment::Beyond`]: Hybrid ICP, the best baseline of each
    /// family, and the presets beyond the paper.
    #[must_use]
    pub fn beyond() -> Vec<Self> {
        [
            Preset::Hybrid,
            Preset::ProjectiveCascadePointPlane,
            Preset::NnCascadePointPlane,
            Preset::HybridVisible,
            Preset::Local,
            Preset::Search,
            Preset::Auto,
        ]
        .map(Self::preset)
        .to_vec()
    }

    /// Creates the variant of a preset.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        Self {
            name: preset.name().to_owned(),
            toml: preset.toml().to_owned(),
        }
    }

    /// Reads a variant from a pipeline file; its name is the file's without the extension.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Pipeline`] when the file cannot be read, is not a pipeline, or requires
    /// more work than the limits allow.
    pub fn read_within(limits: &PipelineLimits, path: &Path) -> Result<Self, ExperimentError> {
        let stem = path.file_stem().unwrap_or_default();
        let variant = Self {
            name: stem.to_string_lossy().into_owned(),
            toml: PipelineFile::read_text(path)?,
        };
        variant.parse(None)?.build_within(limits)?;
        Ok(variant)
    }

    /// Builds the pipeline, with another threshold α if one is given.
    ///
    /// The limits on its work were checked when it was read.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Pipeline`] when the text is not a pipeline, or α is given and the
    /// pipeline does not switch.
    pub fn build(&self, alpha: Option<f64>) -> Result<BoxedStage, ExperimentError> {
        Ok(self.parse(alpha)?.build_within(&PipelineLimits::NONE)?)
    }

    fn parse(&self, alpha: Option<f64>) -> Result<PipelineFile, ExperimentError> {
        let mut file = PipelineFile::parse(&self.toml, &self.name)?;
        if let Some(alpha) = alpha {
            file.set(&format!("{ALPHA_FIELD}={alpha:?}"))?;
        }
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alpha_can_be_set_only_in_pipelines_that_switch() {
        let hybrid = Variant::preset(Preset::Hybrid);
        assert!(hybrid.build(Some(0.25)).is_ok() && hybrid.build(Some(1.0)).is_ok());
        let fixed = Variant::preset(Preset::NnPointToPoint);
        assert!(fixed.build(None).is_ok());
        assert!(fixed.build(Some(0.25)).is_err());
    }

    #[test]
    fn files_that_require_too_much_work_are_refused_when_they_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mine.toml");
        let hybrid = Preset::Hybrid.toml();
        let long = hybrid.replace("times = 2", "times = 2000000000");
        assert_ne!(long, hybrid);
        std::fs::write(&path, long).unwrap();
        assert!(matches!(
            Variant::read_within(&PipelineLimits::DEFAULT, &path),
            Err(ExperimentError::Pipeline(_))
        ));
        let variant = Variant::read_within(&PipelineLimits::NONE, &path).unwrap();
        assert_eq!(variant.name, "mine");
        assert!(variant.build(Some(0.3)).is_ok());
    }
}
