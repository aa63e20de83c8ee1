//! Assignment of rows to masks.

/// Assigns a mask to each row, from the number of pixels of each mask that the model covers.
///
/// `overlaps[row][mask]` is in pixels; every row has one number per mask. Returns the mask of every
/// row, or `None` for a row that covers no pixel of any mask.
///
/// Rows compete: each mask goes to at most one row, and the sum of the overlaps is as large as
/// possible. If two instances of an object are next to each other, and both estimates are nearest
/// to the same one, each row still gets a different mask.
///
/// Two rules keep a row from a mask that hardly belongs to it:
///
/// - A row never gets a mask of which it covers fewer than half as many pixels as of its best mask.
/// - A row that is left without a mask shares its best mask, the first among equals. An example is
///   several estimates of one instance.
///
/// The result is deterministic. Cost: O(masks² · (rows + masks)), for the Hungarian algorithm with
/// the masks as its rows.
///
/// ```
/// use hicp_bop::assign_masks;
/// // Both cover more of the first mask; the second row loses less with the other mask.
/// assert_eq!(assign_masks(&[vec![900, 500], vec![700, 600]]), [Some(0), Some(1)]);
/// // Two estimates of one instance, which hardly touch its neighbor: both keep the first mask.
/// assert_eq!(assign_masks(&[vec![900, 10], vec![800, 20]]), [Some(0), Some(0)]);
/// assert_eq!(assign_masks(&[vec![0, 0]]), [None]);
/// ```
#[must_use]
pub fn assign_masks(overlaps: &[Vec<u64>]) -> Vec<Option<usize>> {
    let own: Vec<Option<usize>> = overlaps
        .iter()
        .map(|of_row| first_largest(of_row))
        .collect();
    let n_masks = overlaps.first().map_or(0, Vec::len);
    if overlaps.len() < 2 || n_masks < 2 {
        return own;
    }
    let gain = |mask: usize, row: usize| {
        let overlap = overlaps[row].get(mask).copied().unwrap_or_default();
        let most = own[row].map_or(0, |own| overlaps[row][own]);
        if overlap >= most.div_ceil(2) {
            overlap
        } else {
            0
        }
    };
    let mut chosen = own.clone();
    for (mask, row) in best_matching(n_masks, overlaps.len(), gain) {
        chosen[row] = Some(mask);
    }
    chosen
}

/// Returns the index of the largest value above 0, the first among equals.
fn first_largest(values: &[u64]) -> Option<usize> {
    // Of equal values, `max_by_key` returns the last.
    let positive = (0..values.len()).rev().filter(|index| values[*index] > 0);
    positive.max_by_key(|index| values[*index])
}

/// Returns a matching with the largest total gain between `n` items on the left and `m` on the
/// right.
///
/// Pairs without gain are not matched. Uses the Hungarian algorithm with shortest augmenting paths.
/// Every item on the left may stay unmatched; `n` additional columns without gain represent this.
fn best_matching(n: usize, m: usize, gain: impl Fn(usize, usize) -> u64) -> Vec<(usize, usize)> {
    let columns = m + n;
    let cost = |left: usize, column: usize| -> i128 {
        if column < m {
            -i128::from(gain(left, column))
        } else {
            0
        }
    };
    // Indices start at 1, because 0 means "none yet".
    let (mut left_price, mut price) = (vec![0_i128; n + 1], vec![0_i128; columns + 1]);
    let mut partner = vec![0_usize; columns + 1];
    for left in 1..=n {
        partner[0] = left;
        let mut current = 0;
        let mut shortest = vec![i128::MAX; columns + 1];
        let mut previous = vec![0_usize; columns + 1];
        let mut done = vec![false; columns + 1];
        while partner[current] != 0 {
            done[current] = true;
            let from = partner[current];
            let (mut step, mut next) = (i128::MAX, 0);
            for column in 1..=columns {
                if done[column] {
                    continue;
                }
                let reduced = cost(from - 1, column - 1) - left_price[from] - price[column];
                if reduced < shortest[column] {
                    (shortest[column], previous[column]) = (reduced, current);
                }
                if shortest[column] < step {
                    (step, next) = (shortest[column], column);
                }
            }
            for column in 0..=columns {
                if done[column] {
                    left_price[partner[column]] += step;
                    price[column] -= step;
                } else if column > 0 {
                    shortest[column] -= step;
                }
            }
            current = next;
        }
        while current != 0 {
            partner[current] = partner[previous[current]];
            current = previous[current];
        }
    }
    (1..=m)
        .filter(|column| partner[*column] != 0)
        .map(|column| (partner[column] - 1, column - 1))
        .filter(|(left, column)| gain(*left, *column) > 0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the largest total gain by exhaustive search.
    fn by_trying(gains: &[Vec<u64>], left: usize, taken: &mut Vec<bool>) -> u64 {
        let Some(of_left) = gains.get(left) else {
            return 0;
        };
        let mut best = by_trying(gains, left + 1, taken);
        for (column, gain) in of_left.iter().enumerate() {
            if !taken[column] {
                taken[column] = true;
                best = best.max(gain + by_trying(gains, left + 1, taken));
                taken[column] = false;
            }
        }
        best
    }

    #[test]
    fn overlaps_may_have_any_size() {
        let overlaps = [vec![u64::MAX, 1], vec![1, 1]];
        assert_eq!(assign_masks(&overlaps), [Some(0), Some(1)]);
    }

    #[test]
    fn the_matching_has_the_largest_total_gain() {
        let mut state = 1_u64;
        let mut next = |bound: u64| -> u64 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) % bound
        };
        for _ in 0..300 {
            let size = |value: u64| usize::try_from(value + 1).unwrap_or(1);
            let (n, m) = (size(next(4)), size(next(5)));
            let gains: Vec<Vec<u64>> = (0..n)
                .map(|_| (0..m).map(|_| next(12).saturating_sub(3)).collect())
                .collect();
            let matching = best_matching(n, m, |left, column| gains[left][column]);
            let found: u64 = matching
                .iter()
                .map(|(left, column)| gains[*left][*column])
                .sum();
            assert_eq!(
                found,
                by_trying(&gains, 0, &mut vec![false; m]),
                "{gains:?}"
            );
            for (index, (left, column)) in matching.iter().enumerate() {
                let others = &matching[index + 1..];
                assert!(others.iter().all(|(l, c)| l != left && c != column));
                assert!(gains[*left][*column] > 0);
            }
        }
    }

    #[test]
    fn surplus_rows_share_masks_and_rows_without_overlap_get_none() {
        // Three estimates of two instances.
        let overlaps = [vec![900, 600], vec![950, 500], vec![500, 800]];
        assert_eq!(assign_masks(&overlaps), [Some(0), Some(0), Some(1)]);
        // The order of the rows only affects ties.
        let reversed: Vec<_> = overlaps.iter().rev().cloned().collect();
        assert_eq!(assign_masks(&reversed), [Some(1), Some(0), Some(0)]);
        // More masks than rows.
        assert_eq!(assign_masks(&[vec![10, 30, 30]]), [Some(1)]);
        let overlaps = [vec![10, 30, 20], vec![0, 40, 25]];
        assert_eq!(assign_masks(&overlaps), [Some(2), Some(1)]);
        assert_eq!(assign_masks(&[vec![], vec![]]), [None, None]);
        assert_eq!(assign_masks(&[]), []);
        // A row without overlap does not affect the others.
        assert_eq!(assign_masks(&[vec![0, 0], vec![5, 4]]), [None, Some(0)]);
    }
}
