//! The rows that a configuration has, and the order in which a run writes them.

use std::collections::{HashMap, HashSet};

use super::row::{Column, Columns, Outcome, Row, quoted};

/// Most names that a message lists.
const LISTED: usize = 12;

/// The objects, settings and variants of a study, and its number of cases.
///
/// A run writes the rows case by case. Those of a case are ordered by setting, then by variant.
#[derive(Clone, Debug)]
pub struct Layout<'a> {
    /// Names of the objects.
    pub objects: Vec<&'a str>,
    /// Names of the settings.
    pub settings: Vec<&'a str>,
    /// Names of the variants.
    pub variants: Vec<&'a str>,
    /// Number of cases of each object.
    pub cases: u64,
    /// Number of bins of the initial VSD. Binned cases go through them in turn.
    pub bins: usize,
    /// Whether cases are binned, by setting.
    pub is_binned: Vec<bool>,
    /// Whether a run goes through all objects before the next case of each; otherwise it finishes
    /// an object first.
    pub is_interleaved: bool,
}

impl<'a> Layout<'a> {
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

    /// Returns the number of bins that rows are averaged in: 1 unless all cases are binned.
    pub(crate) fn n_bins(&self) -> usize {
        let is_binned = self.is_binned.iter().all(|is| *is);
        if is_binned { self.bins.max(1) } else { 1 }
    }

    /// Returns the bin of a case in a setting; `None` if it has none.
    fn bin(&self, setting: usize, case: u64) -> Option<usize> {
        let bin = usize::try_from(case % self.bins.max(1) as u64).ok();
        bin.filter(|_| self.is_binned.get(setting) == Some(&true))
    }

    /// Returns the object and the index among its cases of the n-th case of a run.
    pub(crate) fn case(&self, n: usize) -> (usize, u64) {
        let (n, cases, objects) = (n as u64, self.cases, self.objects.len() as u64);
        #[allow(clippy::cast_possible_truncation)] // An index of an object.
        match self.is_interleaved {
            true => ((n % objects) as usize, n / objects),
            false => ((n / cases) as usize, n % cases),
        }
    }

    /// Returns the rows of a case; `outcomes` are by setting, and in each by variant.
    pub(crate) fn rows(&self, object: usize, case: u64, outcomes: Vec<Outcome>) -> Vec<Row> {
        let mut rows = Vec::new();
        for (place, outcome) in outcomes.into_iter().enumerate() {
            let setting = place / self.variants.len();
            rows.push(Row {
                object: self.objects[object].to_owned(),
                case,
                setting: self.settings[setting].to_owned(),
                variant: self.variants[place % self.variants.len()].to_owned(),
                bin: self.bin(setting, case).filter(|_| outcome.is_ok()),
                note: outcome.as_ref().err().cloned().unwrap_or_default(),
                measured: outcome.ok(),
            });
        }
        rows
    }

    /// Returns the place in the order of a run of a row with these indices.
    fn place(&self, [object, setting, variant]: [usize; 3], case: u64) -> u64 {
        let number = |names: &[&str]| names.len() as u64;
        let nth = match self.is_interleaved {
            true => case * number(&self.objects) + object as u64,
            false => object as u64 * self.cases + case,
        };
        let settings = nth * number(&self.settings) + setting as u64;
        settings * number(&self.variants) + variant as u64
    }

    /// Returns the indices of all names.
    pub(crate) fn index(&self) -> Index<'a> {
        let indices = |names: &[&'a str]| names.iter().copied().zip(0..).collect();
        Index([&self.objects, &self.settings, &self.variants].map(|names| indices(names)))
    }
}

/// The indices of the objects, settings and variants.
pub(crate) struct Index<'a>([HashMap<&'a str, usize>; 3]);

impl Index<'_> {
    /// Returns the indices of a row's object, setting and variant, as far as the study has them.
    pub(crate) fn find(&self, row: &Row) -> [Option<usize>; 3] {
        let [objects, settings, variants] = &self.0;
        [
            objects.get(&*row.object).copied(),
            settings.get(&*row.setting).copied(),
            variants.get(&*row.variant).copied(),
        ]
    }
}

/// Checks that each row is one of the study's, and that none is there twice.
pub(crate) struct Places<'a> {
    layout: Layout<'a>,
    index: Index<'a>,
    columns: &'static Columns,
    seen: HashSet<u64>,
}

impl<'a> Places<'a> {
    pub(crate) fn new(layout: Layout<'a>, columns: &'static Columns) -> Self {
        Self {
            index: layout.index(),
            layout,
            columns,
            seen: HashSet::new(),
        }
    }

    /// Returns the number of rows that a run writes before this one.
    pub(crate) fn take(&mut self, row: &Row) -> Result<u64, String> {
        let layout = &self.layout;
        let named = [
            (Column::Object, &row.object, &layout.objects),
            (Column::Setting, &row.setting, &layout.settings),
            (Column::Variant, &row.variant, &layout.variants),
        ];
        let name = |column| {
            self.columns
                .iter()
                .find(|c| c.1 == column)
                .map_or("", |c| c.0)
        };
        let (found, mut indices) = (self.index.find(row), [0; 3]);
        for (place, (column, text, listed)) in named.into_iter().enumerate() {
            indices[place] = found[place].ok_or_else(|| {
                let more = if listed.len() > LISTED { ", ..." } else { "" };
                let listed: Vec<String> = listed.iter().take(LISTED).map(|n| quoted(n)).collect();
                let (column, text) = (name(column), quoted(text));
                let listed = listed.join(", ");
                format!("{column} is {text}, expected one of config.json: {listed}{more}")
            })?;
        }
        let (column, case, cases) = (name(Column::Case), row.case, layout.cases);
        if case >= cases {
            return Err(format!(
                "{column} is {case}, expected less than {cases}, the number in config.json"
            ));
        }
        let place = layout.place(indices, case);
        if !self.seen.insert(place) {
            let named = named.map(|(column, text, _)| format!("{} {}", name(column), quoted(text)));
            let named = named.join(", ");
            return Err(format!(
                "found {named}, {column} {case} again, expected every row once"
            ));
        }
        // A row without figures need not state its bin.
        let expected = layout.bin(indices[1], case);
        if row.bin != expected && (row.bin.is_some() || row.measured.is_some()) {
            let text = |bin: Option<usize>| bin.map_or("empty".to_owned(), |bin| bin.to_string());
            let (found, expected) = (text(row.bin), text(expected));
            let rule = "cases go through the bins of config.json in turn";
            return Err(format!("bin is {found}, expected {expected}: {rule}"));
        }
        Ok(place)
    }
}
