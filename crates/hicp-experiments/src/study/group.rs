//! Rows that are averaged together.

use std::ops::Range;

/// Label of the group of low initial VSD.
pub const LOW: &str = "low (< 0.3)";
/// Label of the group of high initial VSD.
pub const HIGH: &str = "high (≥ 0.7)";
/// Label of the group of every level with noise.
pub const NOISY: &str = "with noise";
/// Label of the group of all depth noise of [`Experiment::Beyond`](crate::Experiment::Beyond).
pub const NOISY_DEPTH: &str = "depth noise";
/// Label of the group of its reconstructed models.
pub const NOISY_MODEL: &str = "model noise";
/// Label of the group of its imperfect masks.
pub const FAULTY_MASK: &str = "imperfect masks";
/// Label of the group of all rows.
pub const ALL: &str = "all";

/// Rows that are averaged together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Name in tables.
    pub label: String,
    /// Indices of the levels.
    pub levels: Vec<usize>,
    /// The bins; `None` for all.
    pub bins: Option<Range<usize>>,
    /// `true` for a single level or bin, which is a point of the figure.
    pub single: bool,
}

impl Group {
    /// Creates the group of all bins of some levels.
    pub(crate) fn of_levels(label: &str, levels: Vec<usize>) -> Self {
        Self {
            label: label.to_owned(),
            levels,
            bins: None,
            single: false,
        }
    }

    /// Creates the groups of single bins of some levels, then those of low and high initial VSD.
    pub(crate) fn by_bin(levels: &[usize], n_bins: usize) -> Vec<Self> {
        // Use enough digits that no two bins have the same name.
        let digits = match n_bins {
            n if 10 % n == 0 => 1,
            n if 100 % n == 0 => 2,
            _ => 3,
        };
        let edge = |bin: usize| bin as f64 / n_bins as f64;
        let group = |label: String, bins: Range<usize>| Self {
            bins: Some(bins),
            ..Self::of_levels(&label, levels.to_vec())
        };
        let single = |bin: usize| Self {
            single: true,
            ..group(
                format!("{:.digits$}-{:.digits$}", edge(bin), edge(bin + 1)),
                bin..bin + 1,
            )
        };
        // Use only bins that are completely below 0.3, or completely at 0.7 and above.
        let low = group(LOW.to_owned(), 0..n_bins.saturating_mul(3) / 10);
        let first_high = n_bins.saturating_mul(7).div_ceil(10);
        let high = group(HIGH.to_owned(), first_high..n_bins);
        (0..n_bins).map(single).chain([low, high]).collect()
    }

    /// Returns whether a bin is in the group.
    pub(crate) fn holds(&self, bin: usize) -> bool {
        self.bins.as_ref().is_none_or(|bins| bins.contains(&bin))
    }
}
