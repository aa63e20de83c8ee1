//! Statistics for summaries.

/// Returns the median, which is the mean of the middle two of an even number of values; `None` without any.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = values.get(values.len() / 2)?;
    match values.len() % 2 {
        0 => Some(0.5 * (values[values.len() / 2 - 1] + upper)),
        _ => Some(*upper),
    }
}
