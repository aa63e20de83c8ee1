//! Which studies there are, and under which conditions they look at a case.

use std::fmt;
use std::str::FromStr;

use hicp_sim::Household;
use serde::{Deserialize, Serialize};

/// A study of §VI-B of the paper, or the tuning of α in §IV-A.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Experiment {
    /// Robustness to the initial pose (§VI-B.1): ten equal bins of the initial VSD, perfect images.
    InitNoise,
    /// Robustness to depth noise (§VI-B.2): 0 to 5 % of the depth, 6.2 mm and 9.5° off.
    DepthNoise,
    /// Robustness to a wrong model (§VI-B.3): the original and four reconstructions, 6.2 mm and 9.5° off.
    ModelNoise,
    /// Time (§VI-B.4, Table I): a third of its rows under the conditions of each of the three studies above.
    Timing,
    /// The threshold α of Dynamic Switching (§IV-A), on the tuning objects.
    Alpha,
    /// The presets that go beyond the paper: all bins of the initial VSD under depth noise, model noise and imperfect masks.
    Beyond,
}

/// The conditions under which a case is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// Whether the initial pose is drawn into bins of the initial VSD (§VI-B.1) or is 6.2 mm and 9.5° off.
    pub binned: bool,
    /// Standard deviation of the depth noise, percent of the depth.
    pub depth_percent: f64,
    /// 0 for the original model, 1 to 4 for a reconstruction.
    pub model_level: u32,
    /// The threshold α, where it is what is studied.
    pub alpha: Option<f64>,
    /// What is wrong with the mask.
    pub mask: MaskFault,
}

/// What is wrong with the mask of a condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskFault {
    /// Nothing.
    None,
    /// Eroded by 3 pixels.
    Eroded,
    /// Dilated by 3 pixels, over a wall 10 cm behind the object.
    Dilated,
    /// A straight cut removed 20 % of it.
    Missing,
    /// A board in front of the object hides 30 % of it.
    Occluded,
}

impl Condition {
    const PERFECT: Self = Self {
        binned: true,
        depth_percent: 0.0,
        model_level: 0,
        alpha: None,
        mask: MaskFault::None,
    };
    const OFF: Self = Self {
        binned: false,
        ..Self::PERFECT
    };
}

/// Steps of α from 0 to 1, one each 0.05.
const ALPHA_STEPS: u32 = 20;
/// Largest depth noise, percent.
const DEPTH_STEPS: u32 = 5;
/// Number of reconstructions.
const MODEL_STEPS: u32 = 4;

impl Experiment {
    /// Every study.
    pub const ALL: [Self; 6] = [
        Self::InitNoise,
        Self::DepthNoise,
        Self::ModelNoise,
        Self::Timing,
        Self::Alpha,
        Self::Beyond,
    ];

    /// Name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::InitNoise => "init-noise",
            Self::DepthNoise => "depth-noise",
            Self::ModelNoise => "model-noise",
            Self::Timing => "timing",
            Self::Alpha => "alpha",
            Self::Beyond => "beyond",
        }
    }

    /// Heading in reports.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::InitNoise => "Robustness to the initial pose (§VI-B.1)",
            Self::DepthNoise => "Robustness to depth noise (§VI-B.2)",
            Self::ModelNoise => "Robustness to model noise (§VI-B.3)",
            Self::Timing => "Time (§VI-B.4, Table I)",
            Self::Alpha => "The threshold α (§IV-A)",
            Self::Beyond => "Beyond the paper: every start, every imperfection",
        }
    }

    /// What the levels are called.
    #[must_use]
    pub fn level_title(self) -> &'static str {
        match self {
            Self::InitNoise => "level",
            Self::DepthNoise => "depth noise, % of the depth",
            Self::ModelNoise => "model noise level (0: the original)",
            Self::Timing => "conditions",
            Self::Alpha => "α",
            Self::Beyond => "initial VSD (perfect images), then by condition (all starts)",
        }
    }

    /// The objects it is run on unless others are given (§VI-A.1).
    #[must_use]
    pub fn household(self) -> [Household; 10] {
        match self {
            Self::Alpha => Household::TUNING,
            _ => Household::TEST,
        }
    }

    /// Cases per object in the paper.
    #[must_use]
    pub fn paper_poses(self) -> u64 {
        match self {
            Self::InitNoise | Self::Alpha => 1000,
            Self::DepthNoise | Self::ModelNoise | Self::Timing | Self::Beyond => 100,
        }
    }

    /// The levels, as they are written in files.
    #[must_use]
    pub fn levels(self) -> Vec<String> {
        match self {
            Self::InitNoise => vec!["0".to_owned()],
            Self::DepthNoise => (0..=DEPTH_STEPS).map(|p| p.to_string()).collect(),
            Self::ModelNoise => (0..=MODEL_STEPS).map(|l| l.to_string()).collect(),
            Self::Timing => [Self::InitNoise, Self::DepthNoise, Self::ModelNoise]
                .map(|e| e.name().to_owned())
                .to_vec(),
            Self::Alpha => (0..=ALPHA_STEPS)
                .map(|s| format!("{:.2}", alpha(s)))
                .collect(),
            Self::Beyond => beyond().map(|(label, _)| label).collect(),
        }
    }

    /// Whether the initial VSD of its cases falls into bins.
    #[must_use]
    pub fn is_binned(self) -> bool {
        matches!(self, Self::InitNoise | Self::Alpha | Self::Beyond)
    }

    /// The conditions of a level, by its index in [`Experiment::levels`], for a case.
    ///
    /// Only those of [`Experiment::Timing`] depend on the case: it goes through the noise levels of the other studies in turn.
    #[must_use]
    pub fn condition(self, level: usize, case: u64) -> Condition {
        let step = u32::try_from(level).unwrap_or(0);
        let turn = |steps: u32| u32::try_from(case % u64::from(steps + 1)).unwrap_or(0);
        match self {
            Self::InitNoise => Condition::PERFECT,
            Self::DepthNoise => Condition {
                depth_percent: f64::from(step),
                ..Condition::OFF
            },
            Self::ModelNoise => Condition {
                model_level: step,
                ..Condition::OFF
            },
            Self::Timing => match level {
                0 => Condition::PERFECT,
                1 => Self::DepthNoise.condition(turn(DEPTH_STEPS) as usize, case),
                _ => Self::ModelNoise.condition(turn(MODEL_STEPS) as usize, case),
            },
            Self::Alpha => Condition {
                alpha: Some(alpha(step)),
                ..Condition::PERFECT
            },
            Self::Beyond => beyond()
                .nth(level)
                .map_or(Condition::PERFECT, |(_, condition)| condition),
        }
    }
}

/// The levels of [`Experiment::Beyond`] with their conditions.
fn beyond() -> impl Iterator<Item = (String, Condition)> {
    let perfect = Condition::PERFECT;
    let depth = (1..=DEPTH_STEPS).map(move |percent| {
        let depth_percent = f64::from(percent);
        (
            format!("{DEPTH_LEVEL}{percent}"),
            Condition {
                depth_percent,
                ..perfect
            },
        )
    });
    let model = (1..=MODEL_STEPS).map(move |model_level| {
        (
            format!("{MODEL_LEVEL}{model_level}"),
            Condition {
                model_level,
                ..perfect
            },
        )
    });
    let mask = [
        ("eroded", MaskFault::Eroded),
        ("dilated", MaskFault::Dilated),
        ("missing", MaskFault::Missing),
        ("occluded", MaskFault::Occluded),
    ];
    let mask = mask.into_iter().map(move |(label, mask)| {
        (
            format!("{MASK_LEVEL}{label}"),
            Condition { mask, ..perfect },
        )
    });
    std::iter::once(("perfect".to_owned(), perfect))
        .chain(depth)
        .chain(model)
        .chain(mask)
}

/// What the names of the levels of [`Experiment::Beyond`] with depth noise begin with; then comes the percentage.
pub(crate) const DEPTH_LEVEL: &str = "depth-";
/// And of those with a reconstructed model; then comes the level.
pub(crate) const MODEL_LEVEL: &str = "model-";
/// And of those with an imperfect mask.
pub(crate) const MASK_LEVEL: &str = "mask-";

fn alpha(step: u32) -> f64 {
    f64::from(step) / f64::from(ALPHA_STEPS)
}

impl fmt::Display for Experiment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Experiment {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|e| e.name() == name)
            .ok_or_else(|| format!("no study is named {name:?}; the names are: {}", names()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_those_of_the_paper() {
        assert_eq!(
            Experiment::DepthNoise.levels(),
            ["0", "1", "2", "3", "4", "5"]
        );
        assert_eq!(Experiment::DepthNoise.condition(3, 7).depth_percent, 3.0);
        assert_eq!(Experiment::ModelNoise.levels().len(), 5);
        assert_eq!(Experiment::ModelNoise.condition(4, 0).model_level, 4);
        assert!(!Experiment::ModelNoise.condition(4, 0).binned);
        let beyond = Experiment::Beyond.levels();
        assert_eq!((beyond.len(), beyond[3].as_str()), (14, "depth-3"));
        assert_eq!(Experiment::Beyond.condition(9, 0).model_level, 4);
        let occluded = Experiment::Beyond.condition(13, 0);
        assert_eq!(
            (occluded.mask, occluded.binned),
            (MaskFault::Occluded, true)
        );
        let alphas = Experiment::Alpha.levels();
        assert_eq!((alphas.len(), alphas[8].as_str()), (21, "0.40"));
        assert_eq!(Experiment::Alpha.condition(8, 0).alpha, Some(0.4));
    }

    #[test]
    fn timing_goes_through_every_level_of_the_others() {
        let percents: Vec<f64> = (0..6)
            .map(|c| Experiment::Timing.condition(1, c).depth_percent)
            .collect();
        assert_eq!(percents, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let models: Vec<u32> = (0..5)
            .map(|c| Experiment::Timing.condition(2, c).model_level)
            .collect();
        assert_eq!(models, [0, 1, 2, 3, 4]);
    }
}
