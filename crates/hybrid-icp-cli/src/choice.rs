//! The choice of a pipeline.

use std::path::PathBuf;
use std::str::FromStr;
use std::sync::OnceLock;

use clap::Args;
use hybrid_icp::core::UnknownName;
use hybrid_icp::pipeline::{Catalog, PipelineFile};
use hybrid_icp::{BoxedStage, Preset, Refiner};

use crate::limits::pipeline_limits;
use crate::terminal::warn;

static PARTS: OnceLock<Catalog> = OnceLock::new();

/// Sets the parts of this run of the program.
pub(crate) fn choose_parts(catalog: Catalog) {
    // As for limits, the first run decides.
    let _ = PARTS.set(catalog);
}

/// Returns the parts that a pipeline file can name.
pub(crate) fn parts() -> &'static Catalog {
    PARTS.get().unwrap_or_else(|| Catalog::built_in())
}

/// The options that choose a pipeline.
#[derive(Clone, Debug, Args)]
pub(crate) struct PipelineArguments {
    /// The pipeline: a name (`hybrid-icp pipelines` lists them) or a TOML file.
    ///
    /// `auto`, the default, refines locally, and searches if the result stays doubtful. After a
    /// search, the result may be far from the initial pose. `--set max_rotation_degrees=30` and
    /// `--set max_translation_meters=0.05` limit the distance. `color`, the default if color images
    /// are given to a command that uses them and nothing is set, also lets color decide where
    /// depth cannot. `local` never searches. `hybrid` is the paper's method.
    #[arg(long, value_name = "NAME|FILE.toml")]
    pipeline: Option<Source>,
    /// Override a field of the pipeline, such as threshold=0.1 of auto or times=3 of hybrid; may be
    /// given several times.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
}

impl PipelineArguments {
    /// Returns the pipeline file, which no output may replace.
    pub(crate) fn file(&self) -> Option<&PathBuf> {
        self.pipeline.as_ref().and_then(Source::file)
    }

    /// Warns if a color image is given but not used, or the other way around.
    pub(crate) fn check_colors(&self, given: bool) {
        match self.pipeline {
            Some(Source::Preset(Preset::Color)) if !given => {
                warn("there is no --rgb, so --pipeline color does what auto does");
            }
            Some(Source::Preset(preset)) if given && preset != Preset::Color => warn(format!(
                "--rgb is not used: the pipeline {} ignores colors, expected --pipeline color",
                preset.name()
            )),
            _ if given => self.check_overrides(),
            _ => {}
        }
    }

    /// Warns if overrides choose a pipeline that ignores the colors that are given.
    pub(crate) fn check_overrides(&self) {
        if self.pipeline.is_none() && !self.overrides.is_empty() {
            warn(
                "colors are not used: with --set, the pipeline is auto, unless --pipeline color is given",
            );
        }
    }

    /// Warns of overrides that bound a search around an initial pose, for an estimate without one.
    pub(crate) fn check_bounds(&self) {
        for bound in ["max_rotation_degrees", "max_translation_meters"] {
            if self.overrides.iter().any(|set| set.contains(bound)) {
                warn(format!(
                    "--set {bound} has no effect, because there is no initial pose"
                ));
            }
        }
    }

    /// Reads the file, applies the overrides, and checks that the pipeline builds.
    ///
    /// `color` states whether color images are used.
    pub(crate) fn choose(&self, color: bool) -> anyhow::Result<Pipeline> {
        let usual = match color && self.overrides.is_empty() {
            true => Preset::Color,
            false => Preset::Auto,
        };
        let usual = Source::Preset(usual);
        self.pipeline
            .as_ref()
            .unwrap_or(&usual)
            .choose(&self.overrides)
    }
}

/// The value of `--pipeline`: a preset or a file.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    Preset(Preset),
    File(PathBuf),
}

impl FromStr for Source {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        match text.ends_with(".toml") {
            true => Ok(Self::File(text.into())),
            false => text.parse().map(Self::Preset),
        }
    }
}

impl Source {
    /// Returns the file, if it is one.
    pub(crate) fn file(&self) -> Option<&PathBuf> {
        match self {
            Self::File(path) => Some(path),
            Self::Preset(_) => None,
        }
    }

    /// Returns a name for output files: the preset's, or the file's without folder and extension.
    pub(crate) fn short_name(&self) -> String {
        match self {
            Self::Preset(preset) => preset.name().to_owned(),
            Self::File(path) => {
                let stem = path.file_stem().unwrap_or_default();
                stem.to_string_lossy().into_owned()
            }
        }
    }

    /// Reads the file, applies overrides, and checks that the pipeline builds.
    pub(crate) fn choose(&self, overrides: &[String]) -> anyhow::Result<Pipeline> {
        match self {
            Self::Preset(preset) => {
                let toml = preset.toml().to_owned();
                let mut pipeline = Pipeline::parse(preset.name(), toml, overrides)?;
                pipeline.preset = overrides.is_empty().then_some(*preset);
                Ok(pipeline)
            }
            Self::File(path) => {
                let toml = PipelineFile::read_text(path)?;
                Pipeline::parse(&path.display().to_string(), toml, overrides)
            }
        }
    }
}

/// A pipeline that builds. It creates any number of refiners, one per thread.
#[derive(Clone, Debug)]
pub(crate) struct Pipeline {
    /// The name for reports: that of the preset or file, and the overrides.
    pub(crate) name: String,
    /// The text that it was parsed from, before the overrides.
    pub(crate) toml: String,
    pub(crate) overrides: Vec<String>,
    /// The preset, if it is one without overrides.
    pub(crate) preset: Option<Preset>,
    file: PipelineFile,
}

impl Pipeline {
    /// Parses a pipeline, applies overrides, and checks that it builds; messages call it `origin`.
    pub(crate) fn parse(origin: &str, toml: String, overrides: &[String]) -> anyhow::Result<Self> {
        let mut file = PipelineFile::parse(&toml, origin)?;
        let mut name = origin.to_owned();
        for assignment in overrides {
            file.set(assignment)?;
            name = format!("{name} {assignment}");
        }
        file.build_from(parts(), &pipeline_limits())?;
        Ok(Self {
            name,
            toml,
            overrides: overrides.to_vec(),
            file,
            preset: None,
        })
    }

    /// Creates a refiner.
    pub(crate) fn refiner(&self) -> Refiner {
        Refiner::new(self.stage())
    }

    /// Creates the stage alone.
    pub(crate) fn stage(&self) -> BoxedStage {
        let build = || self.file.build_from(parts(), &pipeline_limits());
        // Building is pure, and it worked before.
        let built = || build().unwrap_or_else(|error| unreachable!("{error}"));
        self.preset.map_or_else(built, |preset| preset.build())
    }
}
