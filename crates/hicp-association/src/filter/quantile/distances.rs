//! Order statistics of the distances of pairs.

use hicp_core::Correspondences;

/// Replaces the content of `distances` by the finite distances of the pairs.
pub(crate) fn collect_finite(pairs: &Correspondences, distances: &mut Vec<f32>) {
    distances.clear();
    let all = pairs.as_slice().iter().map(|pair| pair.distance());
    distances.extend(all.filter(|distance| distance.is_finite()));
}

/// Returns the value at position `rank` in ascending order, or the largest if there are fewer.
///
/// Reorders `values`. Without values, returns `None`.
pub(crate) fn nth_smallest(values: &mut [f32], rank: usize) -> Option<f32> {
    let rank = rank.min(values.len().checked_sub(1)?);
    Some(*values.select_nth_unstable_by(rank, f32::total_cmp).1)
}

/// Returns ⌈fraction·count⌉, between 0 and `count`; 0 for NaN.
pub(crate) fn share_of(fraction: f64, count: usize) -> usize {
    // In floating point, 0.07·100 is more than 7, but 7 of 100 are meant.
    let share = (fraction.clamp(0.0, 1.0) * count as f64 * (1.0 - 1e-7)).ceil();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // Between 0 and `count`; NaN becomes 0.
    let share = share as usize;
    share.min(count)
}
