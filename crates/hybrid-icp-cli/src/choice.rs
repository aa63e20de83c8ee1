//! Which pipeline runs.

use std::path::PathBuf;
use std::str::FromStr;

use crate::limits::pipeline_limits;
use clap::Args;
use hybrid_icp::{BoxedStage, PipelineFile, Preset, Refiner, UnknownPreset};

/// The options that choose a pipeline.
#[derive(Clone, Debug, Args)]
pub(crate) struct PipelineArguments {
    /// The pipeline: a name (`hybrid-icp pipelines` lists them) or a TOML file.
    ///
    /// `auto` refines locally and searches where the MVE stays above 0.2: it may then end far from the initial pose, within
    /// what `--set max_rotation_degrees=30` and `--set max_translation_meters=0.05` allow. `local` never searches, `hybrid` is
    /// the paper's method.
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "auto")]
    pipeline: Source,
    /// Overrides a field of the pipeline, such as threshold=0.2 of auto or times=3 of hybrid; may be given several times.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
}

/// What `--pipeline` names.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    Preset(Preset),
    File(PathBuf),
}

impl FromStr for Source {
    type Err = UnknownPreset;

    fn from_str(text: &str) -> Result<Self, UnknownPreset> {
        if text.ends_with(".toml") {
            Ok(Self::File(text.into()))
        } else {
            text.parse().map(Self::Preset)
        }
    }
}

/// A pipeline that is known to build: makes any number of refiners, one per thread.
#[derive(Clone, Debug)]
pub(crate) struct Pipeline {
    name: String,
    made_of: MadeOf,
    toml: String,
    overrides: Vec<String>,
}

#[derive(Clone, Debug)]
enum MadeOf {
    Preset(Preset),
    File(PipelineFile),
}

impl Source {
    /// The file, where it is one.
    pub(crate) fn file(&self) -> Option<&PathBuf> {
        match self {
            Self::File(path) => Some(path),
            Self::Preset(_) => None,
        }
    }

    /// A name for files: the preset's, or the file's without folder and ending.
    pub(crate) fn short_name(&self) -> String {
        match self {
            Self::Preset(preset) => preset.name().to_owned(),
            Self::File(path) => path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
        }
    }
}

impl PipelineArguments {
    /// A pipeline without overrides.
    pub(crate) fn plain(pipeline: Source) -> Self {
        Self {
            pipeline,
            overrides: Vec::new(),
        }
    }

    /// The pipeline file, so that no output overwrites it.
    pub(crate) fn file(&self) -> Option<&PathBuf> {
        self.pipeline.file()
    }

    /// Reads the file, applies the overrides, and makes sure that the pipeline builds.
    pub(crate) fn choose(&self) -> anyhow::Result<Pipeline> {
        match &self.pipeline {
            Source::Preset(preset) if self.overrides.is_empty() => Ok(Pipeline {
                name: preset.name().to_owned(),
                made_of: MadeOf::Preset(*preset),
                toml: preset.toml().to_owned(),
                overrides: Vec::new(),
            }),
            Source::Preset(preset) => {
                Pipeline::parse(preset.name(), preset.toml().to_owned(), &self.overrides)
            }
            Source::File(path) => {
                let name = path.display().to_string();
                let toml = PipelineFile::read_text(path)?;
                Pipeline::parse(&name, toml, &self.overrides)
            }
        }
    }
}

impl Pipeline {
    /// Parses a pipeline, applies the overrides, and makes sure that it builds; `origin` is what messages call it.
    pub(crate) fn parse(origin: &str, toml: String, overrides: &[String]) -> anyhow::Result<Self> {
        let mut file = PipelineFile::parse(&toml, origin)?;
        for assignment in overrides {
            file.set(assignment)?;
        }
        file.build_within(&pipeline_limits())?;
        let name = std::iter::once(origin.to_owned())
            .chain(overrides.iter().cloned())
            .collect::<Vec<_>>()
            .join(" ");
        Ok(Self {
            name,
            made_of: MadeOf::File(file),
            toml,
            overrides: overrides.to_vec(),
        })
    }

    /// The text that it was made from, before the overrides.
    pub(crate) fn toml(&self) -> &str {
        &self.toml
    }

    /// The preset, where it is one as it is.
    pub(crate) fn preset(&self) -> Option<Preset> {
        match self.made_of {
            MadeOf::Preset(preset) => Some(preset),
            MadeOf::File(_) => None,
        }
    }

    /// The overrides, in order.
    pub(crate) fn overrides(&self) -> &[String] {
        &self.overrides
    }

    /// Name in reports: that of the preset or file, and the overrides.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Makes a refiner.
    pub(crate) fn refiner(&self) -> Refiner {
        match &self.made_of {
            MadeOf::Preset(preset) => Refiner::preset(*preset),
            MadeOf::File(_) => Refiner::boxed(self.stage()),
        }
    }

    /// Makes the stage alone.
    pub(crate) fn stage(&self) -> BoxedStage {
        match &self.made_of {
            MadeOf::Preset(preset) => preset.build(),
            MadeOf::File(file) => match file.build_within(&pipeline_limits()) {
                Ok(stage) => stage,
                // It was built once, and building is pure.
                Err(error) => unreachable!("{error}"),
            },
        }
    }
}
