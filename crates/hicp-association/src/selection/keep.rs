//! Compaction of a list by position, in place and in order.

/// Keeps the elements at the given positions, which must ascend. Positions past the end are
/// ignored.
pub(crate) fn keep_positions<T: Copy>(
    list: &mut Vec<T>,
    positions: impl IntoIterator<Item = usize>,
) {
    let mut kept = 0;
    for position in positions {
        let Some(&element) = list.get(position) else {
            break;
        };
        list[kept] = element;
        kept += 1;
    }
    list.truncate(kept);
}

/// Returns the position of the i-th of `count` elements spread evenly over `length`.
///
/// It is the middle of the element's share, ⌊(i + ½)·length/count⌋.
pub(crate) fn spread(i: usize, count: usize, length: usize) -> usize {
    // Computed in u128, since the product may exceed 64 bits. The quotient is below `length`.
    let position = (2 * i as u128 + 1) * length as u128 / (2 * count.max(1) as u128);
    let Ok(position) = usize::try_from(position) else {
        unreachable!("the quotient is below `length`, a usize");
    };
    position
}
