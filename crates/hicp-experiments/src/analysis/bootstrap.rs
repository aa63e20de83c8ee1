//! Means with bootstrap intervals over objects and cases.

use std::collections::{BTreeMap, HashMap};

use hicp_sim::stream;
use rand::RngExt;

use super::cell::Cell;
use super::interval::{Interval, never_seen, quantile};
use super::metric::Metric;
use crate::study::{Design, Group, Measured, StudyOf};

/// Number of bootstrap samples.
pub const REPLICATES: usize = 2000;

/// A case of an object, with the figures of every variant at every level.
#[derive(Debug)]
struct Unit {
    object: usize,
    bin: usize,
    /// Ordered by level, then by variant.
    measured: Vec<Option<Measured>>,
}

/// The means of a study, per bin, level and overall, with bootstrap intervals.
///
/// A bootstrap sample draws objects with replacement. For each object it draws the same number of
/// cases in every bin, with replacement. A drawn case contributes all its variants and levels, so
/// that differences are paired. The samples depend on the seed alone.
///
/// Rows without figures are left out. Cost: O([`REPLICATES`] · rows).
#[derive(Debug)]
pub struct Analysis {
    variants: Vec<String>,
    groups: Vec<Group>,
    diameters_mm: Vec<f64>,
    n_levels: usize,
    n_bins: usize,
    units: Vec<Unit>,
    /// Sums and weights, indexed by [`Analysis::slot`]. The first element is of the rows as they
    /// are, the others are of bootstrap samples.
    replicates: Vec<Vec<f64>>,
}

impl Analysis {
    /// Analyzes a study.
    #[must_use]
    pub fn of<D: Design>(study: &StudyOf<D>) -> Self {
        let config = &study.config;
        let (layout, variants) = (config.layout(), config.compared());
        let (cells, n_bins) = (layout.rows_per_case(), layout.n_bins());
        let objects = indices(layout.objects.iter().map(|object| &*object.name));
        let settings = indices(layout.settings.iter().copied());
        let columns = indices(layout.variants.iter().copied());
        let mut places = HashMap::new();
        let mut units: Vec<Unit> = Vec::new();
        for row in &study.rows {
            let (object, setting) = (objects.get(&*row.object), settings.get(&*row.setting));
            let (Some(&object), Some(&setting), Some(&column), Some(measured)) =
                (object, setting, columns.get(&*row.variant), &row.measured)
            else {
                continue;
            };
            let place = *places.entry((object, row.case)).or_insert_with(|| {
                units.push(Unit {
                    object,
                    bin: row.bin.unwrap_or(0).min(n_bins - 1),
                    measured: vec![None; cells],
                });
                units.len() - 1
            });
            let cell = setting * layout.variants.len() + column;
            units[place].measured[cell] = Some(measured.clone());
        }
        let mut analysis = Self {
            n_levels: cells.checked_div(variants.len()).unwrap_or(0),
            variants,
            groups: config.groups(),
            diameters_mm: layout.objects.iter().map(|o| o.diameter_mm).collect(),
            n_bins,
            units,
            replicates: Vec::new(),
        };
        analysis.replicates = analysis.bootstrap(layout.seed);
        analysis
    }

    /// Returns the names of the variants.
    #[must_use]
    pub fn variants(&self) -> &[String] {
        &self.variants
    }

    /// Returns the groups: single bins or levels first, then ranges of them, all rows last.
    #[must_use]
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// Returns the index of the group with a label.
    #[must_use]
    pub fn group(&self, label: &str) -> Option<usize> {
        self.groups.iter().position(|g| g.label == label)
    }

    /// Returns the index of a variant.
    #[must_use]
    pub fn variant(&self, name: &str) -> Option<usize> {
        self.variants.iter().position(|v| v == name)
    }

    /// Returns the index of the group of all rows.
    #[must_use]
    pub fn overall(&self) -> usize {
        self.groups.len() - 1
    }

    /// Returns every group with its label, and in each every variant with its name.
    pub(crate) fn grid(&self) -> impl Iterator<Item = (usize, &str, usize, &str)> {
        let groups = self.groups.iter().enumerate();
        groups.flat_map(|(group, described)| {
            let variants = self.variants.iter().enumerate();
            variants.map(move |(v, name)| (group, &*described.label, v, &**name))
        })
    }

    /// Returns the number of bins of the initial VSD; 1 if cases are not binned.
    pub(crate) fn n_bins(&self) -> usize {
        self.n_bins
    }

    /// Returns a mean with its interval. If no row has the figure, returns `None`.
    #[must_use]
    pub fn mean(&self, metric: Metric, group: usize, variant: usize) -> Option<Interval> {
        self.contrast(metric, &[(group, variant, 1.0)])
    }

    /// Returns the paired difference of the means of two variants in a group.
    #[must_use]
    pub fn difference(&self, metric: Metric, group: usize, a: usize, b: usize) -> Option<Interval> {
        self.contrast(metric, &[(group, a, 1.0), (group, b, -1.0)])
    }

    /// Returns a sum of means times factors, with its interval.
    ///
    /// A term is a group, a variant and a factor.
    #[must_use]
    pub fn contrast(&self, metric: Metric, terms: &[(usize, usize, f64)]) -> Option<Interval> {
        let value = |sums: &Vec<f64>| -> f64 {
            let mean = |(g, v, factor)| factor * self.mean_of(metric, sums, g, v);
            terms.iter().copied().map(mean).sum()
        };
        let (all, samples) = self.replicates.split_first()?;
        let estimate = Some(value(all)).filter(|x| x.is_finite())?;
        let mut drawn: Vec<f64> = samples.iter().map(value).collect();
        drawn.retain(|x| x.is_finite());
        drawn.sort_by(f64::total_cmp);
        let cases = terms.iter().map(|(g, v, _)| self.cases(*g, *v)).min();
        let cases = cases.unwrap_or(0);
        let mut interval = Interval {
            cases,
            estimate,
            low: quantile(&drawn, 0.025).unwrap_or(estimate),
            high: quantile(&drawn, 0.975).unwrap_or(estimate),
        };
        if metric.is_share() && interval.low >= interval.high {
            let unseen = never_seen(cases);
            // No share is below 0 or above 1. The sum of no terms would be −0.
            let bound = |sign: f64| {
                let factors = terms.iter().map(|t| t.2).filter(|f| f * sign > 0.0);
                factors.fold(0.0, std::ops::Add::add)
            };
            interval.low = (estimate - unseen).max(bound(-1.0));
            interval.high = (estimate + unseen).min(bound(1.0));
        }
        Some(interval)
    }

    /// Returns the figures of a variant in a group. If there are no rows, returns `None`.
    #[must_use]
    pub fn cell(&self, group: usize, variant: usize) -> Option<Cell> {
        let group = self.groups.get(group)?;
        let units = self.units.iter();
        let rows = units.flat_map(|unit| {
            let figures = self.figures(unit, group, variant);
            figures.map(|measured| (self.diameters_mm[unit.object], measured))
        });
        Cell::of(&rows.collect::<Vec<_>>())
    }

    /// Returns the figures of a variant for all units and levels of a group.
    pub(crate) fn all_figures(
        &self,
        group: usize,
        variant: usize,
    ) -> impl Iterator<Item = &Measured> {
        let group = &self.groups[group];
        let units = self.units.iter();
        units.flat_map(move |unit| self.figures(unit, group, variant))
    }

    /// Returns the number of cases for which a variant has rows in a group.
    ///
    /// Rows of one case under several conditions are not independent.
    fn cases(&self, group: usize, variant: usize) -> usize {
        let Some(group) = self.groups.get(group) else {
            return 0;
        };
        let is_in = |unit: &&Unit| self.figures(unit, group, variant).next().is_some();
        self.units.iter().filter(is_in).count()
    }

    /// Returns the figures of a variant for a unit, one per level of a group.
    fn figures<'a>(
        &self,
        unit: &'a Unit,
        group: &Group,
        variant: usize,
    ) -> impl Iterator<Item = &'a Measured> {
        let n_variants = self.variants.len();
        let is_in = variant < n_variants && group.holds(unit.bin);
        let levels = group.levels.iter().filter(move |_| is_in);
        levels.filter_map(move |level| unit.measured[level * n_variants + variant].as_ref())
    }

    /// Returns the index of the sum of a metric among the sums of a sample.
    ///
    /// The next element is its weight.
    fn slot(&self, metric: Metric, level: usize, variant: usize, bin: usize) -> usize {
        let cell = (metric as usize * self.n_levels + level) * self.variants.len() + variant;
        2 * (cell * self.n_bins + bin)
    }

    fn mean_of(&self, metric: Metric, sums: &[f64], group: usize, variant: usize) -> f64 {
        let Some(group) = self.groups.get(group) else {
            return f64::NAN;
        };
        if variant >= self.variants.len() {
            return f64::NAN;
        }
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

    /// Returns the sums over all units with these weights.
    fn sums(&self, weights: &[f64]) -> Vec<f64> {
        let n_variants = self.variants.len();
        let cells = self.n_levels * n_variants * self.n_bins;
        let mut sums = vec![0.0; 2 * Metric::ALL.len() * cells];
        for (unit, weight) in self.units.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
            for (index, measured) in unit.measured.iter().enumerate() {
                let Some(measured) = measured else { continue };
                for metric in Metric::ALL {
                    if let Some(value) = metric.of(measured) {
                        let (level, variant) = (index / n_variants, index % n_variants);
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
        // The units, by object and then by bin.
        let mut strata: BTreeMap<usize, BTreeMap<usize, Vec<usize>>> = BTreeMap::new();
        for (index, unit) in self.units.iter().enumerate() {
            let bins = strata.entry(unit.object).or_default();
            bins.entry(unit.bin).or_default().push(index);
        }
        let strata: Vec<_> = strata.into_values().collect();
        let mut replicates = vec![self.sums(&vec![1.0; self.units.len()])];
        if strata.is_empty() {
            return replicates;
        }
        for sample in 0..REPLICATES {
            let mut rng = stream(seed, &["bootstrap"], sample as u64);
            let mut weights = vec![0.0; self.units.len()];
            for _ in 0..strata.len() {
                for units in strata[rng.random_range(0..strata.len())].values() {
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

/// Returns the index of each name.
fn indices<'a>(names: impl Iterator<Item = &'a str>) -> HashMap<&'a str, usize> {
    names.zip(0..).collect()
}
