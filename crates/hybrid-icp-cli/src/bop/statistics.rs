//! Statistics for summaries.

use std::collections::BTreeMap;

/// Returns a line per kind of image, with the number of its images.
pub(crate) fn count<'a>(kinds: impl Iterator<Item = &'a str>) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for kind in kinds {
        *counts.entry(kind).or_default() += 1;
    }
    let counts = counts.iter();
    counts
        .map(|(kind, count)| format!("\n  {count:>7}  {kind}"))
        .collect()
}

/// Returns the median; for an even number of values, the mean of the middle two.
///
/// Returns `None` without values.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = values.get(values.len() / 2)?;
    match values.len() % 2 {
        0 => Some(0.5 * (values[values.len() / 2 - 1] + upper)),
        _ => Some(*upper),
    }
}
