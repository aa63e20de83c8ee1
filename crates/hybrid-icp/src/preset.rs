//! Presets by name.

use std::str::FromStr;

use hicp_core::UnknownName;
use hicp_core::internal::named;
use hicp_icp::BoxedStage;

use crate::presets;

/// Declares the presets: per line the variant, the name, the function in [`presets`], a summary.
macro_rules! declare {
    ($($variant:ident, $name:literal, $function:ident, $summary:literal;)*) => {
        /// A pipeline that ships with the library.
        ///
        /// Use [`Preset::Auto`], the default, unless you have a reason not to. [`Preset::Local`]
        /// never searches, [`Preset::Search`] searches sooner, and [`Preset::Color`] also compares
        /// colors. The first nine are Hybrid ICP and the eight baselines of the paper, by their
        /// names there.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Preset {
            $(
                #[doc = concat!($summary, ". See [`presets::", stringify!($function), "`].")]
                $variant,
            )*
        }

        impl Preset {
            /// Every preset, Hybrid ICP first, those of the paper before the others.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$variant),*];

            /// Returns the name on the command line and in tables.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// Returns a one-line description.
            #[must_use]
            pub fn summary(self) -> &'static str {
                match self { $(Self::$variant => $summary,)* }
            }

            /// Returns the pipeline as the text of a TOML file.
            ///
            /// The stage that `PipelineFile` builds from it gives the same bits as
            /// [`Preset::build`].
            #[must_use]
            pub fn toml(self) -> &'static str {
                match self {
                    $(Self::$variant => include_str!(concat!("../pipelines/", $name, ".toml")),)*
                }
            }

            /// Builds the pipeline.
            #[must_use]
            pub fn build(self) -> BoxedStage {
                match self { $(Self::$variant => Box::new(presets::$function()),)* }
            }
        }
    };
}

/// [`Preset::Auto`].
impl Default for Preset {
    fn default() -> Self {
        Self::Auto
    }
}

declare! {
    Hybrid, "hybrid", hybrid,
        "Hybrid ICP: twice, by the MVE, the projective cascade (below 0.4) or nn-point-to-point";
    ProjectivePointToPoint, "projective-point-to-point", projective_point_to_point,
        "visible surface, projective pairs, point-to-point";
    ProjectivePointToPlane, "projective-point-to-plane", projective_point_to_plane,
        "visible surface, projective pairs, point-to-plane";
    ProjectiveCascadePointPlane, "projective-cascade-point-plane", projective_cascade_point_plane,
        "Cascading ICP: projective point-to-point, then projective point-to-plane";
    ProjectiveCascadePlanePoint, "projective-cascade-plane-point", projective_cascade_plane_point,
        "projective point-to-plane, then projective point-to-point";
    NnPointToPoint, "nn-point-to-point", nn_point_to_point,
        "whole surface, nearest neighbors, point-to-point";
    NnPointToPlane, "nn-point-to-plane", nn_point_to_plane,
        "whole surface, nearest neighbors, point-to-plane";
    NnCascadePointPlane, "nn-cascade-point-plane", nn_cascade_point_plane,
        "nearest-neighbor point-to-point, then nearest-neighbor point-to-plane";
    NnCascadePlanePoint, "nn-cascade-plane-point", nn_cascade_plane_point,
        "nearest-neighbor point-to-plane, then nearest-neighbor point-to-point";
    HybridVisible, "hybrid-visible", hybrid_visible,
        "Hybrid ICP with visible points for nearest neighbors too, gates and the symmetric metric";
    Local, "local", local,
        "local refinement that never raises its score (an MVE for imperfect masks): fits surface and silhouette, and tries other pairs in doubt";
    Search, "search", search,
        "global: local, and if doubt × score is above 0.002 a search over 1000 rotations, or above 0.001 far from the initial pose; may end at an equivalent pose";
    Auto, "auto", auto,
        "global where needed: local, and if doubt × score is above 0.03 a search over 1000 rotations, or above 0.001 far from the initial pose";
    Color, "color", color,
        "global where needed: auto, and color decides among poses that depth cannot tell apart";
}

impl Preset {
    /// The presets of the paper, Hybrid ICP first: those that its studies compare.
    pub const PAPER: [Self; 9] = match Self::ALL.first_chunk() {
        Some(paper) => *paper,
        None => unreachable!(),
    };
}

impl std::fmt::Display for Preset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Preset {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        named("pipeline", name, &Self::ALL, Self::name)
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
    fn summaries_state_the_options_of_the_search() {
        for (preset, built) in [
            (Preset::Search, presets::search()),
            (Preset::Auto, presets::auto()),
        ] {
            let (least, count) = (built.options.threshold, built.options.hypotheses);
            let stated = format!("doubt × score is above {least} a search over {count} rotations");
            assert!(preset.summary().contains(&stated), "{preset}: {stated}");
        }
    }

    #[test]
    fn a_misspelt_name_is_answered_with_the_nearest_name() {
        let error = "nn-point-to-plan".parse::<Preset>().unwrap_err();
        assert_eq!(error.suggestion, Some("nn-point-to-plane"));
        assert!(error.to_string().contains("projective-cascade-plane-point"));
    }
}
