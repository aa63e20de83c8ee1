//! Presets by name.

use std::str::FromStr;

use hicp_icp::Stage;
use thiserror::Error;

use crate::presets;
use crate::suggest::nearest;

/// A pipeline behind a box, as it is read from a name: the same code and the same bits as the literal.
pub type BoxedStage = Box<dyn Stage + Send>;

/// A pipeline that ships with the library: Hybrid ICP or one of the eight baselines, by its name in the paper, or one that goes
/// beyond it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Preset {
    /// [`presets::hybrid`].
    Hybrid,
    /// [`presets::projective_point_to_point`].
    ProjectivePointToPoint,
    /// [`presets::projective_point_to_plane`].
    ProjectivePointToPlane,
    /// [`presets::projective_cascade_point_plane`].
    ProjectiveCascadePointPlane,
    /// [`presets::projective_cascade_plane_point`].
    ProjectiveCascadePlanePoint,
    /// [`presets::nn_point_to_point`].
    NnPointToPoint,
    /// [`presets::nn_point_to_plane`].
    NnPointToPlane,
    /// [`presets::nn_cascade_point_plane`].
    NnCascadePointPlane,
    /// [`presets::nn_cascade_plane_point`].
    NnCascadePlanePoint,
    /// [`presets::hybrid_visible`].
    HybridVisible,
    /// [`presets::local`].
    Local,
    /// [`presets::search`].
    Search,
    /// [`presets::auto`].
    Auto,
}

impl Preset {
    /// Every preset, Hybrid ICP first, those of the paper before the others.
    pub const ALL: [Self; 13] = [
        Self::Hybrid,
        Self::ProjectivePointToPoint,
        Self::ProjectivePointToPlane,
        Self::ProjectiveCascadePointPlane,
        Self::ProjectiveCascadePlanePoint,
        Self::NnPointToPoint,
        Self::NnPointToPlane,
        Self::NnCascadePointPlane,
        Self::NnCascadePlanePoint,
        Self::HybridVisible,
        Self::Local,
        Self::Search,
        Self::Auto,
    ];

    /// The presets of the paper, Hybrid ICP first: what its studies compare.
    pub const PAPER: [Self; 9] = [
        Self::Hybrid,
        Self::ProjectivePointToPoint,
        Self::ProjectivePointToPlane,
        Self::ProjectiveCascadePointPlane,
        Self::ProjectiveCascadePlanePoint,
        Self::NnPointToPoint,
        Self::NnPointToPlane,
        Self::NnCascadePointPlane,
        Self::NnCascadePlanePoint,
    ];

    /// Name on the command line and in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Hybrid => "hybrid",
            Self::ProjectivePointToPoint => "projective-point-to-point",
            Self::ProjectivePointToPlane => "projective-point-to-plane",
            Self::ProjectiveCascadePointPlane => "projective-cascade-point-plane",
            Self::ProjectiveCascadePlanePoint => "projective-cascade-plane-point",
            Self::NnPointToPoint => "nn-point-to-point",
            Self::NnPointToPlane => "nn-point-to-plane",
            Self::NnCascadePointPlane => "nn-cascade-point-plane",
            Self::NnCascadePlanePoint => "nn-cascade-plane-point",
            Self::HybridVisible => "hybrid-visible",
            Self::Local => "local",
            Self::Search => "search",
            Self::Auto => "auto",
        }
    }

    /// One line about it.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Hybrid => {
                "Hybrid ICP: twice, by the MVE, the projective cascade (below 0.4) or nn-point-to-point"
            }
            Self::ProjectivePointToPoint => "visible surface, projective pairs, point-to-point",
            Self::ProjectivePointToPlane => "visible surface, projective pairs, point-to-plane",
            Self::ProjectiveCascadePointPlane => {
                "Cascading ICP: projective point-to-point, then projective point-to-plane"
            }
            Self::ProjectiveCascadePlanePoint => {
                "projective point-to-plane, then projective point-to-point"
            }
            Self::NnPointToPoint => "whole surface, nearest neighbours, point-to-point",
            Self::NnPointToPlane => "whole surface, nearest neighbours, point-to-plane",
            Self::NnCascadePointPlane => {
                "nearest-neighbour point-to-point, then nearest-neighbour point-to-plane"
            }
            Self::NnCascadePlanePoint => {
                "nearest-neighbour point-to-plane, then nearest-neighbour point-to-point"
            }
            Self::HybridVisible => {
                "Hybrid ICP with visible points for nearest neighbours too, gates and the symmetric metric"
            }
            Self::Local => {
                "local refinement that never raises the MVE: steps until it stalls, observed points to the model from afar"
            }
            Self::Search => {
                "global: local, and above an MVE of 0.15 a search over 256 rotations; may end at an equivalent pose"
            }
            Self::Auto => {
                "global where needed: local, and above an MVE of 0.2 a search over 128 rotations"
            }
        }
    }

    /// The pipeline as a file: what [`crate::PipelineFile`] builds from it gives the same bits as [`Preset::build`].
    #[must_use]
    pub fn toml(self) -> &'static str {
        match self {
            Self::Hybrid => include_str!("../pipelines/hybrid.toml"),
            Self::ProjectivePointToPoint => {
                include_str!("../pipelines/projective-point-to-point.toml")
            }
            Self::ProjectivePointToPlane => {
                include_str!("../pipelines/projective-point-to-plane.toml")
            }
            Self::ProjectiveCascadePointPlane => {
                include_str!("../pipelines/projective-cascade-point-plane.toml")
            }
            Self::ProjectiveCascadePlanePoint => {
                include_str!("../pipelines/projective-cascade-plane-point.toml")
            }
            Self::NnPointToPoint => {
                include_str!("../pipelines/nn-point-to-point.toml")
            }
            Self::NnPointToPlane => {
                include_str!("../pipelines/nn-point-to-plane.toml")
            }
            Self::NnCascadePointPlane => {
                include_str!("../pipelines/nn-cascade-point-plane.toml")
            }
            Self::NnCascadePlanePoint => {
                include_str!("../pipelines/nn-cascade-plane-point.toml")
            }
            Self::HybridVisible => include_str!("../pipelines/hybrid-visible.toml"),
            Self::Local => include_str!("../pipelines/local.toml"),
            Self::Search => include_str!("../pipelines/search.toml"),
            Self::Auto => include_str!("../pipelines/auto.toml"),
        }
    }

    /// Builds the pipeline.
    #[must_use]
    pub fn build(self) -> BoxedStage {
        match self {
            Self::Hybrid => Box::new(presets::hybrid()),
            Self::ProjectivePointToPoint => Box::new(presets::projective_point_to_point()),
            Self::ProjectivePointToPlane => Box::new(presets::projective_point_to_plane()),
            Self::ProjectiveCascadePointPlane => {
                Box::new(presets::projective_cascade_point_plane())
            }
            Self::ProjectiveCascadePlanePoint => {
                Box::new(presets::projective_cascade_plane_point())
            }
            Self::NnPointToPoint => Box::new(presets::nn_point_to_point()),
            Self::NnPointToPlane => Box::new(presets::nn_point_to_plane()),
            Self::NnCascadePointPlane => Box::new(presets::nn_cascade_point_plane()),
            Self::NnCascadePlanePoint => Box::new(presets::nn_cascade_plane_point()),
            Self::HybridVisible => Box::new(presets::hybrid_visible()),
            Self::Local => Box::new(presets::local()),
            Self::Search => Box::new(presets::search()),
            Self::Auto => Box::new(presets::auto()),
        }
    }
}

impl std::fmt::Display for Preset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

/// A name that no preset has.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("no pipeline is named {name:?}{}; the names are: {}", did_you_mean(*suggestion), names())]
pub struct UnknownPreset {
    /// The name given.
    pub name: String,
    /// The name nearest to it, if one is near.
    pub suggestion: Option<&'static str>,
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |name| format!("; did you mean {name:?}?"))
}

fn names() -> String {
    Preset::ALL.map(Preset::name).join(", ")
}

impl FromStr for Preset {
    type Err = UnknownPreset;

    fn from_str(name: &str) -> Result<Self, UnknownPreset> {
        if let Some(preset) = Self::ALL.into_iter().find(|p| p.name() == name) {
            return Ok(preset);
        }
        let suggestion = nearest(name, Self::ALL.map(Self::name));
        Err(UnknownPreset {
            name: name.to_owned(),
            suggestion,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_reads_back() {
        for preset in Preset::ALL {
            assert_eq!(preset.name().parse(), Ok(preset));
        }
    }

    #[test]
    fn a_misspelt_name_is_answered_with_the_nearest() {
        let error = "nn-point-to-plan".parse::<Preset>().unwrap_err();
        assert_eq!(error.suggestion, Some("nn-point-to-plane"));
        assert!(error.to_string().contains("projective-cascade-plane-point"));
    }
}
