//! Means of a study with intervals, and differences between its variants.

use std::collections::{BTreeMap, HashMap};

use hicp_sim::stream;
use rand::RngExt;

use crate::experiment::{DEPTH_LEVEL, Experiment, MASK_LEVEL, MODEL_LEVEL};
use crate::row::Measured;
use crate::study::Study;

/// A mean VSD above this is a failure.
pub const FAILURE_VSD: f64 = 0.3;
/// A mean VSD that rose by more than this made the pose worse.
pub const WORSE_VSD: f64 = 0.02;
/// An ADD(-S) below this share of the diameter is a success, as in the literature on ADD.
pub const ADD_SHARE: f64 = 0.1;
/// Number of bootstrap samples.
pub const REPLICATES: usize = 2000;
/// The bins of the initial VSD that count as low: all of the bin is below 0.3.
fn low_bins(n_bins: usize) -> std::ops::Range<usize> {
    0..n_bins.saturating_mul(3) / 10
}

/// The bins that count as high: all of the bin is 0.7 and above.
fn high_bins(n_bins: usize) -> std::ops::Range<usize> {
    n_bins.saturating_mul(7).div_ceil(10)..n_bins
}

/// Which figure of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metric {
    /// Mean VSD of the returned pose.
    Vsd,
    /// Whether it is above [`FAILURE_VSD`].
    Failure,
    /// Processor time, milliseconds.
    CpuMs,
    /// Whether the mean VSD is above that of the initial pose by more than [`WORSE_VSD`].
    Worse,
}

impl Metric {
    const ALL: [Self; 4] = [Self::Vsd, Self::Failure, Self::CpuMs, Self::Worse];

    /// Whether its mean is the share of rows of which something holds.
    fn is_share(self) -> bool {
        matches!(self, Self::Failure | Self::Worse)
    }

    fn of(self, measured: &Measured) -> Option<f64> {
        match self {
            Self::Vsd => Some(measured.vsd_final),
            Self::Failure => Some(f64::from(u8::from(measured.vsd_final > FAILURE_VSD))),
            Self::CpuMs => measured.cpu_ms,
            Self::Worse => Some(f64::from(u8::from(
                measured.vsd_final > measured.vsd_initial + WORSE_VSD,
            ))),
        }
    }
}

/// An estimate with its 95 % interval: the 2.5th and 97.5th percentiles of the bootstrap; of a share on which no bootstrap sample
/// differs, what [`never_seen`] leaves possible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The estimate from all rows.
    pub estimate: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Rows that are averaged together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Name in tables.
    pub label: String,
    /// Indices of the levels.
    pub levels: Vec<usize>,
    /// The bins, where not all.
    pub bins: Option<std::ops::Range<usize>>,
    /// Whether it is one level or bin, a point of the figure, rather than a range of them.
    pub single: bool,
}

impl Group {
    fn holds(&self, bin: usize) -> bool {
        self.bins.as_ref().is_none_or(|bins| bins.contains(&bin))
    }
}

/// Figures of a variant in a group, without intervals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Number of rows.
    pub count: usize,
    /// Mean VSD of the initial poses.
    pub vsd_initial: f64,
    /// Median ADD(-S), millimetres.
    pub add_median_mm: f64,
    /// Share of rows whose ADD(-S) is below [`ADD_SHARE`] of the diameter.
    pub add_success: f64,
    /// Mean number of iterations.
    pub iterations: f64,
    /// Standard deviation of the processor time, milliseconds; `None` without times.
    pub cpu_deviation_ms: Option<f64>,
}

/// A case of an object, with what was measured at every level by every variant.
struct Unit {
    object: usize,
    bin: usize,
    /// By level, then by variant.
    measured: Vec<Option<Measured>>,
}

/// The means of a study, per bin, level and overall, with bootstrap intervals over objects and poses.
///
/// A bootstrap sample draws objects with replacement, and for each the same number of cases in every bin with replacement. All
/// variants and levels of a drawn case come along, so that differences are paired. The sample is the same for the same seed.
///
/// A case whose rows could not be made is left out. Cost: O([`REPLICATES`] · rows).
pub struct Analysis {
    experiment: Experiment,
    variants: Vec<String>,
    groups: Vec<Group>,
    diameters_mm: Vec<f64>,
    n_levels: usize,
    n_bins: usize,
    units: Vec<Unit>,
    /// Sums by metric, then as [`Sums`]; the first of each is of the rows as they are, the others are bootstrap samples.
    replicates: Vec<Vec<f64>>,
}

impl std::fmt::Debug for Analysis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Analysis")
            .field("experiment", &self.experiment)
            .field("units", &self.units.len())
            .finish_non_exhaustive()
    }
}

impl Analysis {
    /// Analyses a study.
    #[must_use]
    pub fn of(study: &Study) -> Self {
        let config = &study.config;
        let variants: Vec<String> = config.variants.iter().map(|v| v.name.clone()).collect();
        let n_bins = if config.experiment.is_binned() {
            config.bins.max(1)
        } else {
            1
        };
        let units = units(study, n_bins);
        let mut analysis = Self {
            experiment: config.experiment,
            groups: groups(config.experiment, &config.levels, n_bins),
            diameters_mm: config.objects.iter().map(|o| o.diameter_mm).collect(),
            variants,
            n_levels: config.levels.len(),
            n_bins,
            units,
            replicates: Vec::new(),
        };
        analysis.replicates = analysis.bootstrap(config.seed);
        analysis
    }

    /// Which study.
    #[must_use]
    pub fn experiment(&self) -> Experiment {
        self.experiment
    }

    /// Names of the variants.
    #[must_use]
    pub fn variants(&self) -> &[String] {
        &self.variants
    }

    /// The groups: single bins or levels first, then ranges of them, all rows last.
    #[must_use]
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// The index of the group of a label.
    #[must_use]
    pub fn group(&self, label: &str) -> Option<usize> {
        self.groups.iter().position(|g| g.label == label)
    }

    /// The index of a variant.
    #[must_use]
    pub fn variant(&self, name: &str) -> Option<usize> {
        self.variants.iter().position(|v| v == name)
    }

    /// The group of all rows.
    #[must_use]
    pub fn overall(&self) -> usize {
        self.groups.len() - 1
    }

    /// A mean with its interval; `None` where no row has the figure.
    #[must_use]
    pub fn mean(&self, metric: Metric, group: usize, variant: usize) -> Option<Interval> {
        self.contrast(metric, &[(group, variant, 1.0)])
    }

    /// A sum of means times factors, with its interval: (A, 1), (B, −1) is the paired difference A − B.
    #[must_use]
    pub fn contrast(&self, metric: Metric, terms: &[(usize, usize, f64)]) -> Option<Interval> {
        let value = |sums: &Vec<f64>| -> f64 {
            terms
                .iter()
                .map(|(g, v, factor)| factor * self.mean_of(metric, sums, *g, *v))
                .sum()
        };
        let (all, samples) = self.replicates.split_first()?;
        let estimate = value(all);
        if !estimate.is_finite() {
            return None;
        }
        let mut drawn: Vec<f64> = samples
            .iter()
            .map(value)
            .filter(|x| x.is_finite())
            .collect();
        drawn.sort_by(f64::total_cmp);
        let mut interval = Interval {
            estimate,
            low: quantile(&drawn, 0.025).unwrap_or(estimate),
            high: quantile(&drawn, 0.975).unwrap_or(estimate),
        };
        if metric.is_share() && interval.low >= interval.high {
            let cases = terms.iter().map(|(g, v, _)| self.cases(*g, *v)).min();
            let unseen = never_seen(cases.unwrap_or(0));
            // No share is below 0 or above 1.
            let bound =
                |sign: f64| -> f64 { terms.iter().map(|t| t.2).filter(|f| f * sign > 0.0).sum() };
            interval.low = (estimate - unseen).max(bound(-1.0));
            interval.high = (estimate + unseen).min(bound(1.0));
        }
        Some(interval)
    }

    /// Number of cases of which a variant has rows in a group. The rows of one case, under several conditions, are no
    /// independent ones.
    fn cases(&self, group: usize, variant: usize) -> usize {
        let Some(group) = self.groups.get(group) else {
            return 0;
        };
        let seen = |unit: &&Unit| {
            let mut levels = group.levels.iter();
            group.holds(unit.bin)
                && levels.any(|l| unit.measured[l * self.variants.len() + variant].is_some())
        };
        self.units.iter().filter(seen).count()
    }

    /// Figures of a variant in a group; `None` where there is no row.
    #[must_use]
    pub fn cell(&self, group: usize, variant: usize) -> Option<Cell> {
        let group = self.groups.get(group)?;
        if variant >= self.variants.len() {
            return None;
        }
        let rows: Vec<(&Unit, &Measured)> = self
            .units
            .iter()
            .filter(|unit| group.holds(unit.bin))
            .flat_map(|unit| group.levels.iter().map(move |level| (unit, *level)))
            .filter_map(|(unit, level)| {
                let measured = unit.measured[level * self.variants.len() + variant].as_ref()?;
                Some((unit, measured))
            })
            .collect();
        if rows.is_empty() {
            return None;
        }
        let count = rows.len() as f64;
        let mean = |value: &dyn Fn(&(&Unit, &Measured)) -> f64| {
            rows.iter().map(value).sum::<f64>() / count
        };
        let mut errors: Vec<f64> = rows.iter().map(|(_, m)| m.add_final_mm).collect();
        errors.sort_by(f64::total_cmp);
        let times: Option<Vec<f64>> = rows.iter().map(|(_, m)| m.cpu_ms).collect();
        Some(Cell {
            count: rows.len(),
            vsd_initial: mean(&|(_, m)| m.vsd_initial),
            add_median_mm: quantile(&errors, 0.5).unwrap_or(0.0),
            add_success: mean(&|(unit, m)| {
                f64::from(u8::from(
                    m.add_final_mm < ADD_SHARE * self.diameters_mm[unit.object],
                ))
            }),
            iterations: mean(&|(_, m)| m.iterations as f64),
            cpu_deviation_ms: times.map(|times| {
                let mean = times.iter().sum::<f64>() / count;
                let squares: f64 = times.iter().map(|t| (t - mean).powi(2)).sum();
                (squares / (count - 1.0).max(1.0)).sqrt()
            }),
        })
    }

    /// Where the sum of a metric is among the sums of a sample; its weight comes right after.
    fn slot(&self, metric: Metric, level: usize, variant: usize, bin: usize) -> usize {
        2 * (((metric as usize * self.n_levels + level) * self.variants.len() + variant)
            * self.n_bins
            + bin)
    }

    /// Number of bins of the initial VSD; 1 where cases are not binned.
    pub(crate) fn n_bins(&self) -> usize {
        self.n_bins
    }

    fn mean_of(&self, metric: Metric, sums: &[f64], group: usize, variant: usize) -> f64 {
        let Some(group) = self
            .groups
            .get(group)
            .filter(|_| variant < self.variants.len())
        else {
            return f64::NAN;
        };
        let bins = group.bins.clone().unwrap_or(0..self.n_bins);
        let (mut sum, mut weight) = (0.0, 0.0);
        for level in &group.levels {
            for bin in bins.clone() {
                let slot = self.slot(metric, *level, variant, bin);
                sum += sums[slot];
                weight += sums[slot + 1];
            }
        }
        sum / weight
    }

    /// Returns the sums of a weighting of the units.
    fn sums(&self, weights: &[f64]) -> Vec<f64> {
        let cells = self.n_levels * self.variants.len() * self.n_bins;
        let mut sums = vec![0.0; 2 * Metric::ALL.len() * cells];
        for (unit, weight) in self.units.iter().zip(weights) {
            if *weight == 0.0 {
                continue;
            }
            for (index, measured) in unit.measured.iter().enumerate() {
                let Some(measured) = measured else { continue };
                let (level, variant) = (index / self.variants.len(), index % self.variants.len());
                for metric in Metric::ALL {
                    if let Some(value) = metric.of(measured) {
                        let slot = self.slot(metric, level, variant, unit.bin);
                        sums[slot] += weight * value;
                        sums[slot + 1] += weight;
                    }
                }
            }
        }
        sums
    }

    fn bootstrap(&self, seed: u64) -> Vec<Vec<f64>> {
        // By object, then by bin, the units.
        let mut strata: BTreeMap<usize, BTreeMap<usize, Vec<usize>>> = BTreeMap::new();
        for (index, unit) in self.units.iter().enumerate() {
            let bins = strata.entry(unit.object).or_default();
            bins.entry(unit.bin).or_default().push(index);
        }
        let strata: Vec<Vec<Vec<usize>>> = strata
            .into_values()
            .map(|bins| bins.into_values().collect())
            .collect();
        let mut replicates = vec![self.sums(&vec![1.0; self.units.len()])];
        if strata.is_empty() {
            return replicates;
        }
        let mut weights = vec![0.0; self.units.len()];
        for sample in 0..REPLICATES {
            let mut rng = stream(seed, &["bootstrap"], sample as u64);
            weights.fill(0.0);
            for _ in 0..strata.len() {
                for units in &strata[rng.random_range(0..strata.len())] {
                    for _ in 0..units.len() {
                        weights[units[rng.random_range(0..units.len())]] += 1.0;
                    }
                }
            }
            replicates.push(self.sums(&weights));
        }
        replicates
    }
}

/// Puts the rows of each case together.
fn units(study: &Study, n_bins: usize) -> Vec<Unit> {
    let config = &study.config;
    let (variants, width) = (&config.variants, config.rows_per_case());
    let mut places = HashMap::new();
    let objects: HashMap<&str, usize> = indices(config.objects.iter().map(|o| &*o.name));
    let levels = indices(config.levels.iter().map(|l| &**l));
    let names = indices(variants.iter().map(|v| &*v.name));
    let mut units: Vec<Unit> = Vec::new();
    for row in &study.rows {
        let find = (
            objects.get(&*row.object).copied(),
            levels.get(&*row.level).copied(),
            names.get(&*row.variant).copied(),
        );
        let (Some(object), Some(level), Some(variant)) = find else {
            continue;
        };
        let Some(measured) = &row.measured else {
            continue;
        };
        let place = *places.entry((object, row.case)).or_insert_with(|| {
            units.push(Unit {
                object,
                bin: if n_bins > 1 {
                    row.bin.unwrap_or(0).min(n_bins - 1)
                } else {
                    0
                },
                measured: vec![None; width],
            });
            units.len() - 1
        });
        units[place].measured[level * variants.len() + variant] = Some(measured.clone());
    }
    units
}

/// The index of every name.
fn indices<'a>(names: impl Iterator<Item = &'a str>) -> HashMap<&'a str, usize> {
    names
        .enumerate()
        .map(|(index, name)| (name, index))
        .collect()
}

/// The groups of a study.
fn groups(experiment: Experiment, levels: &[String], n_bins: usize) -> Vec<Group> {
    let all: Vec<usize> = (0..levels.len()).collect();
    let mut groups = Vec::new();
    let range = |label: &str, levels: Vec<usize>, bins| Group {
        label: label.to_owned(),
        levels,
        bins,
        single: false,
    };
    if matches!(experiment, Experiment::InitNoise | Experiment::Beyond) {
        // Of a study with imperfect images, the bins are those of its perfect ones.
        let all = if experiment == Experiment::Beyond {
            all.iter().copied().take(1).collect()
        } else {
            all.clone()
        };
        // So many digits that no two bins are named alike.
        let digits = match n_bins {
            n if 10 % n == 0 => 1,
            n if 100 % n == 0 => 2,
            _ => 3,
        };
        for bin in 0..n_bins {
            let edge = |bin: usize| bin as f64 / n_bins as f64;
            groups.push(Group {
                label: format!("{:.digits$}-{:.digits$}", edge(bin), edge(bin + 1)),
                levels: all.clone(),
                bins: Some(bin..bin + 1),
                single: true,
            });
        }
        groups.push(range(LOW, all.clone(), Some(low_bins(n_bins))));
        groups.push(range(HIGH, all, Some(high_bins(n_bins))));
    }
    if experiment != Experiment::InitNoise {
        groups.extend(all.iter().map(|level| Group {
            label: levels[*level].clone(),
            levels: vec![*level],
            bins: None,
            single: experiment != Experiment::Beyond,
        }));
    }
    if experiment == Experiment::Beyond {
        for (label, prefix) in [
            (NOISY_DEPTH, DEPTH_LEVEL),
            (NOISY_MODEL, MODEL_LEVEL),
            (FAULTY_MASK, MASK_LEVEL),
        ] {
            let with = |level: &usize| levels[*level].starts_with(prefix);
            let of_kind = (0..levels.len()).filter(with).collect();
            groups.push(range(label, of_kind, None));
        }
    }
    if matches!(experiment, Experiment::DepthNoise | Experiment::ModelNoise) {
        let noisy = all.iter().copied().skip(1).collect();
        groups.push(range(NOISY, noisy, None));
    }
    groups.push(range(ALL, all, None));
    groups
}

/// Label of the group of low initial VSD.
pub const LOW: &str = "low (< 0.3)";
/// Label of the group of high initial VSD.
pub const HIGH: &str = "high (≥ 0.7)";
/// Label of the group of every level with noise.
pub const NOISY: &str = "with noise";
/// Label of the group of all depth noise of [`Experiment::Beyond`].
pub const NOISY_DEPTH: &str = "depth noise";
/// Label of the group of its reconstructed models.
pub const NOISY_MODEL: &str = "model noise";
/// Label of the group of its imperfect masks.
pub const FAULTY_MASK: &str = "imperfect masks";
/// Label of the group of all rows.
pub const ALL: &str = "all";

/// The largest share of which it is not unlikely (5 %) that none of so many independent cases shows it: 1 − 0.05^(1/n), the exact
/// (Clopper–Pearson) one-sided bound, about 3/n. A bootstrap over cases that are all alike knows no interval.
#[must_use]
pub fn never_seen(cases: usize) -> f64 {
    1.0 - 0.05_f64.powf(1.0 / cases as f64)
}

/// Returns a quantile of sorted values, between neighbours in proportion; `None` without any.
fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = share * last as f64;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // Between 0 and the last index.
    let below = place.floor() as usize;
    let above = (below + 1).min(last);
    let part = place - below as f64;
    Some(sorted[below] * (1.0 - part) + sorted[above] * part)
}
