//! Statistics for summaries.

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
