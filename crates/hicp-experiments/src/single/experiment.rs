//! The studies of single images, and their levels.

use hicp_sim::{Corruption, Household};
use serde::{Deserialize, Serialize};

use super::condition::Condition;
use crate::study::{ALL, FAULTY_MASK, Group, NOISY, NOISY_DEPTH, NOISY_MODEL};

/// A study of §VI-B of the paper, or the tuning of α in §IV-A.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Experiment {
    /// Robustness to the initial pose (§VI-B.1): ten equal bins of the initial VSD, perfect images.
    InitNoise,
    /// Robustness to depth noise of 0 to 5 % (§VI-B.2), from starts 6.2 mm and 9.5° off.
    DepthNoise,
    /// Robustness to a wrong model (§VI-B.3), from starts 6.2 mm and 9.5° off.
    ///
    /// The models are the original and four reconstructions.
    ModelNoise,
    /// Time (§VI-B.4, Table I). Each of the studies above provides the conditions of a third of the
    /// rows.
    Timing,
    /// The threshold α of Dynamic Switching (§IV-A), on the tuning objects.
    Alpha,
    /// The presets beyond the paper, from every start, with depth noise, model noise and imperfect
    /// masks.
    Beyond,
}

/// A name, and a change of an image.
type Named = (&'static str, fn(&mut Corruption));
/// The imperfect masks of [`Experiment::Beyond`], with their names.
///
/// A dilated mask needs a wall behind the object, because the added pixels need a depth.
const MASKS: [Named; 4] = [
    ("eroded", |image| image.mask.erosion_pixels = 3),
    ("dilated", |image| {
        (image.mask.dilation_pixels, image.wall_behind_meters) = (3, Some(0.1));
    }),
    ("missing", |image| image.mask.missing_share = 0.2),
    ("occluded", |image| image.occluded_share = 0.3),
];
/// The groups of imperfect images of [`Experiment::Beyond`], with the prefixes of their levels.
const KINDS: [(&str, &str); 3] = [
    (NOISY_DEPTH, "depth-"),
    (NOISY_MODEL, "model-"),
    (FAULTY_MASK, "mask-"),
];
/// Number of steps of α from 0 to 1.
const ALPHA_STEPS: u32 = 20;
/// Largest depth noise, percent.
const DEPTH_STEPS: u32 = 5;
/// Number of reconstructions.
const MODEL_STEPS: u32 = 4;

use Experiment::*;

impl Experiment {
    /// Every study.
    pub const ALL: [Self; 6] = [InitNoise, DepthNoise, ModelNoise, Timing, Alpha, Beyond];

    /// Returns the name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.names().0
    }

    /// Returns the heading in reports.
    #[must_use]
    pub fn title(self) -> &'static str {
        self.names().1
    }

    fn names(self) -> (&'static str, &'static str) {
        match self {
            InitNoise => ("init-noise", "Robustness to the initial pose (§VI-B.1)"),
            DepthNoise => ("depth-noise", "Robustness to depth noise (§VI-B.2)"),
            ModelNoise => ("model-noise", "Robustness to model noise (§VI-B.3)"),
            Timing => ("timing", "Time (§VI-B.4, Table I)"),
            Alpha => ("alpha", "The threshold α (§IV-A)"),
            Beyond => (
                "beyond",
                "Beyond the paper: every start, every imperfection",
            ),
        }
    }

    /// Returns the default objects (§VI-A.1).
    #[must_use]
    pub fn household(self) -> [Household; 10] {
        match self {
            Alpha => Household::TUNING,
            _ => Household::TEST,
        }
    }

    /// Returns whether all cases are binned by their initial VSD.
    #[must_use]
    pub fn is_binned(self) -> bool {
        self.conditions(0).iter().all(|level| level.1.binned)
    }

    /// Returns the names of the levels in files.
    #[must_use]
    pub fn levels(self) -> Vec<String> {
        self.conditions(0)
            .into_iter()
            .map(|level| level.0)
            .collect()
    }

    /// Returns the condition of a level for a case.
    ///
    /// `level` is an index into [`Experiment::levels`]. Only [`Experiment::Timing`] depends on the
    /// case: it cycles through the noise levels of the other studies.
    #[must_use]
    pub fn condition(self, level: usize, case: u64) -> Condition {
        let nth = self.conditions(case).into_iter().nth(level);
        nth.map_or_else(|| Condition::perfect(true), |(_, condition)| condition)
    }

    /// Returns the thresholds α of the first `levels`, or one `None` if they do not change α.
    pub(super) fn alphas(self, levels: usize) -> Vec<Option<f64>> {
        let levels = self.conditions(0).into_iter().take(levels);
        let alphas: Vec<Option<f64>> = levels.filter_map(|level| level.1.alpha).map(Some).collect();
        if alphas.is_empty() {
            vec![None]
        } else {
            alphas
        }
    }

    /// Returns the levels with their conditions.
    fn conditions(self, case: u64) -> Vec<(String, Condition)> {
        let (binned, off) = (Condition::perfect(true), Condition::perfect(false));
        match self {
            InitNoise => vec![("0".to_owned(), binned)],
            DepthNoise => {
                let levels = 0..=DEPTH_STEPS;
                levels.map(|p| (p.to_string(), off.depth(p))).collect()
            }
            ModelNoise => {
                let levels = 0..=MODEL_STEPS;
                levels.map(|l| (l.to_string(), off.model(l))).collect()
            }
            Timing => {
                let one = |study: Self| {
                    let mut levels = study.conditions(0);
                    #[allow(clippy::cast_possible_truncation)] // Below the number of levels.
                    let nth = (case % levels.len() as u64) as usize;
                    (study.name().to_owned(), levels.swap_remove(nth).1)
                };
                [InitNoise, DepthNoise, ModelNoise].map(one).into()
            }
            Alpha => {
                let alphas = (0..=ALPHA_STEPS).map(|step| f64::from(step) / f64::from(ALPHA_STEPS));
                alphas
                    .map(|alpha| (format!("{alpha:.2}"), binned.alpha(alpha)))
                    .collect()
            }
            Beyond => {
                let mut all = vec![("perfect".to_owned(), binned)];
                all.extend((1..=DEPTH_STEPS).map(|p| (format!("depth-{p}"), binned.depth(p))));
                all.extend((1..=MODEL_STEPS).map(|l| (format!("model-{l}"), binned.model(l))));
                all.extend(MASKS.map(|(name, how)| (format!("mask-{name}"), binned.corrupt(how))));
                all
            }
        }
    }

    /// Returns the groups of a study with some levels.
    pub(super) fn groups(self, levels: &[String], n_bins: usize) -> Vec<Group> {
        let all: Vec<usize> = (0..levels.len()).collect();
        let mut groups = match self {
            InitNoise => Group::by_bin(&all, n_bins),
            // The bins are those of the perfect images.
            Beyond => Group::by_bin(&all[..all.len().min(1)], n_bins),
            _ => Vec::new(),
        };
        if self != InitNoise {
            groups.extend(all.iter().map(|level| Group {
                single: self != Beyond,
                ..Group::of_levels(&levels[*level], vec![*level])
            }));
        }
        if self == Beyond {
            groups.extend(KINDS.map(|(label, kind)| {
                let is_of_kind = |level: &usize| levels[*level].starts_with(kind);
                Group::of_levels(label, all.iter().copied().filter(is_of_kind).collect())
            }));
        }
        if matches!(self, DepthNoise | ModelNoise) {
            let noisy = all.iter().copied().skip(1).collect();
            groups.push(Group::of_levels(NOISY, noisy));
        }
        groups.push(Group::of_levels(ALL, all));
        groups
    }
}

#[cfg(test)]
mod tests {
    use hicp_sim::DepthNoise;

    use super::*;

    fn percent(condition: Condition) -> f64 {
        match condition.corruption.sensor.noise {
            DepthNoise::Relative(noise) => noise.percent,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn levels_are_those_of_the_paper() {
        assert_eq!(DepthNoise.levels(), ["0", "1", "2", "3", "4", "5"]);
        assert_eq!(percent(DepthNoise.condition(3, 7)), 3.0);
        assert_eq!(ModelNoise.levels().len(), 5);
        assert_eq!(ModelNoise.condition(4, 0).model_level, 4);
        assert!(!ModelNoise.condition(4, 0).binned);
        let beyond = Beyond.levels();
        assert_eq!((beyond.len(), beyond[3].as_str()), (14, "depth-3"));
        assert_eq!(Beyond.condition(9, 0).model_level, 4);
        let occluded = Beyond.condition(13, 0);
        assert_eq!(occluded.corruption.occluded_share, 0.3);
        assert!(occluded.binned);
        let alphas = Alpha.levels();
        assert_eq!((alphas.len(), alphas[8].as_str()), (21, "0.40"));
        assert_eq!(Alpha.condition(8, 0).alpha, Some(0.4));
    }

    #[test]
    fn timing_cycles_through_every_level_of_the_other_studies() {
        let percents: Vec<f64> = (0..6).map(|c| percent(Timing.condition(1, c))).collect();
        assert_eq!(percents, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let models: Vec<u32> = (0..5).map(|c| Timing.condition(2, c).model_level).collect();
        assert_eq!(models, [0, 1, 2, 3, 4]);
    }
}
