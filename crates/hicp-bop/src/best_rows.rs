//! Selection of the best rows per image and object.

use std::borrow::Borrow;
use std::collections::BTreeMap;

use hicp_io::bop::ResultRow;
use hybrid_icp::score::top_estimates;

use crate::frames::Targets;

/// Keeps the rows with the best scores per image and object, in the order of the file.
///
/// With `targets`, rows without a target are dropped, and `inst_count` rows of every target are
/// kept, as in the benchmark's toolkit. The result contains exactly the rows that an evaluation
/// uses. With `top`, at most `top` rows per image and object are kept. Of equal scores, the first
/// is kept. Without both options, all rows are kept. A row may be a value that contains a
/// [`ResultRow`].
///
/// Cost: O(n log n).
///
/// ```
/// use hicp_io::bop::ResultRow;
/// use hybrid_icp::core::Isometry3;
/// let row = |object, score| {
///     let mut row = ResultRow::new(1, 2, object, Isometry3::identity());
///     row.score = score;
///     row
/// };
/// let rows = vec![row(5, 0.2), row(5, 0.9), row(7, 0.1), row(5, 0.9)];
/// let kept = hicp_bop::best_rows(rows, Some(1), None);
/// assert_eq!(kept, [row(5, 0.9), row(7, 0.1)]);
/// ```
#[must_use]
pub fn best_rows<T: Borrow<ResultRow>>(
    rows: Vec<T>,
    top: Option<usize>,
    targets: Option<&Targets>,
) -> Vec<T> {
    if top.is_none() && targets.is_none() {
        return rows;
    }
    let mut groups: BTreeMap<(u32, u32, u32), Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().map(Borrow::borrow).enumerate() {
        let group = (row.scene_id, row.im_id, row.obj_id);
        groups.entry(group).or_default().push(index);
    }
    let mut kept = vec![false; rows.len()];
    for ((scene_id, im_id, obj_id), indices) in groups {
        let wanted = targets.map_or(usize::MAX, |targets| {
            let of_frame = targets.get(&(scene_id, im_id));
            let count = of_frame.and_then(|objects| objects.get(&obj_id));
            count.map_or(0, |count| *count as usize)
        });
        let scores: Vec<f64> = indices
            .iter()
            .map(|index| rows[*index].borrow().score)
            .collect();
        for best in top_estimates(&scores, wanted.min(top.unwrap_or(usize::MAX))) {
            kept[indices[best]] = true;
        }
    }
    let rows = rows.into_iter().zip(kept);
    rows.filter_map(|(row, kept)| kept.then_some(row)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybrid_icp::core::Isometry3;

    fn rows() -> Vec<ResultRow> {
        let row = |(im_id, obj_id, score)| {
            let mut row = ResultRow::new(1, im_id, obj_id, Isometry3::identity());
            row.score = score;
            row
        };
        [
            (1, 5, 0.3),
            (2, 5, 0.1),
            (1, 5, 0.7),
            (1, 6, 0.2),
            (1, 5, 0.3),
        ]
        .map(row)
        .to_vec()
    }

    fn kept(top: Option<usize>, targets: Option<&Targets>) -> Vec<(u32, u32, f64)> {
        let kept = best_rows(rows(), top, targets);
        let key = |row: &ResultRow| (row.im_id, row.obj_id, row.score);
        kept.iter().map(key).collect()
    }

    #[test]
    fn the_best_rows_per_image_and_object_stay_in_order() {
        assert_eq!(best_rows(rows(), None, None), rows());
        assert_eq!(kept(Some(1), None), [(2, 5, 0.1), (1, 5, 0.7), (1, 6, 0.2)]);
        // Of equal scores, the first is kept.
        let best = best_rows(rows(), Some(2), None);
        assert_eq!(best, [0, 1, 2, 3].map(|index| rows()[index].clone()));
        assert_eq!(best_rows(rows(), Some(9), None), rows());
    }

    #[test]
    fn targets_limit_the_objects_and_their_number() {
        let targets = Targets::from([((1, 1), BTreeMap::from([(5, 2), (7, 1)]))]);
        assert_eq!(kept(None, Some(&targets)), [(1, 5, 0.3), (1, 5, 0.7)]);
        assert_eq!(kept(Some(1), Some(&targets)), [(1, 5, 0.7)]);
        assert!(kept(None, Some(&Targets::new())).is_empty());
    }
}
