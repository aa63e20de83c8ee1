//! The rows of a configuration, and the order in which a run writes them.

use hicp_core::PinholeCamera;

use super::records::ObjectRecord;
use super::row::{Outcome, Row};

/// The objects, settings and variants of a study, and its number of cases.
///
/// A run writes the rows case by case. Those of a case are ordered by setting, then by variant.
#[derive(Clone, Debug)]
pub struct Layout<'a> {
    /// Seed of all random numbers.
    pub seed: u64,
    /// The camera.
    pub camera: PinholeCamera,
    /// The objects.
    pub objects: &'a [ObjectRecord],
    /// Names of the settings.
    pub settings: Vec<&'a str>,
    /// Names of the variants.
    pub variants: Vec<&'a str>,
    /// Number of cases of each object.
    pub cases: u64,
    /// Number of bins of the initial VSD. Binned cases cycle through them, or are spread evenly if
    /// they are fewer.
    pub bins: usize,
    /// `true` if the cases of each setting are binned.
    pub is_binned: Vec<bool>,
    /// If `true`, a run evaluates one case of every object before the next case of any object.
    /// Otherwise it finishes one object after another.
    pub is_interleaved: bool,
}

impl Layout<'_> {
    /// Returns the number of cases of all objects.
    #[must_use]
    pub fn n_cases(&self) -> usize {
        let cases = usize::try_from(self.cases).unwrap_or(usize::MAX);
        cases.saturating_mul(self.objects.len())
    }

    /// Returns the number of rows of a case.
    #[must_use]
    pub fn rows_per_case(&self) -> usize {
        self.settings.len().saturating_mul(self.variants.len())
    }

    /// Returns the number of bins of the averages: 1 unless all cases are binned.
    pub(crate) fn n_bins(&self) -> usize {
        let is_binned = self.is_binned.iter().all(|is| *is);
        if is_binned { self.bins.max(1) } else { 1 }
    }

    /// Returns the object of the n-th case of a run, and the index of the case within the object.
    pub(crate) fn case(&self, n: usize) -> (usize, u64) {
        let (n, cases, objects) = (n as u64, self.cases, self.objects.len() as u64);
        let (object, case) = match self.is_interleaved {
            true => (n % objects, n / objects),
            false => (n / cases, n % cases),
        };
        // The index of a case determines its bin.
        let bins = self.bins as u64;
        let is_sparse = cases < bins && self.is_binned.contains(&true);
        #[allow(clippy::cast_possible_truncation)] // An index of an object.
        (
            object as usize,
            if is_sparse { case * bins / cases } else { case },
        )
    }

    /// Returns the n-th row of a run without its figures. After the last one, returns `None`.
    pub(crate) fn row(&self, n: usize) -> Option<Row> {
        let nth = n.checked_div(self.rows_per_case())?;
        if nth >= self.n_cases() {
            return None;
        }
        let (object, case) = self.case(nth);
        let variants = self.variants.len();
        let (setting, variant) = (n / variants % self.settings.len(), n % variants);
        #[allow(clippy::cast_possible_truncation)] // Below the number of bins.
        let bin = (case % self.bins.max(1) as u64) as usize;
        Some(Row {
            object: self.objects[object].name.clone(),
            case,
            setting: self.settings[setting].to_owned(),
            variant: self.variants[variant].to_owned(),
            bin: self.is_binned[setting].then_some(bin),
            measured: None,
            note: String::new(),
        })
    }

    /// Returns the rows of the n-th case of a run. `outcomes` have the order of the rows.
    pub(crate) fn rows(&self, n: usize, outcomes: Vec<Outcome>) -> Vec<Row> {
        let places = n * self.rows_per_case()..;
        let rows = places.map_while(|place| self.row(place)).zip(outcomes);
        rows.map(|(row, outcome)| row.with(outcome)).collect()
    }
}
