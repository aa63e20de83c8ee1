//! Parts of a result file, for refining it on several machines.

use std::borrow::Borrow;
use std::collections::HashMap;
use std::fmt;
use std::str::FromStr;

use hicp_io::bop::ResultRow;

/// Part `index` of `count`, counted from 1 and written as `index/count`.
///
/// ```
/// let shard: hicp_bop::Shard = "2/8".parse()?;
/// assert_eq!(shard.to_string(), "2/8");
/// assert!("0/8".parse::<hicp_bop::Shard>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u32,
    count: u32,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/');
        let numbers = parts.and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((index, count)) if (1..=count).contains(&index) => Ok(Self { index, count }),
            _ => Err("expected I/N with 1 <= I <= N, such as 2/8".to_owned()),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// The result of [`Shard::take`].
#[derive(Debug)]
pub struct Part<T = ResultRow> {
    /// The shard's rows, in the order of the file.
    pub rows: Vec<T>,
    /// `true` if the rows of every image are adjacent in the whole file.
    ///
    /// If so, the concatenated shards have the order of the file.
    pub contiguous: bool,
}

impl Shard {
    /// Keeps the rows of the shard's images.
    ///
    /// Images are in the order of their first rows and are never split. Each shard has an equal
    /// share of the rows, laid out image by image. An image belongs to the shard in whose share its
    /// first row lies. Every row is therefore in exactly one shard, in any order of the rows. A
    /// shard may be empty.
    ///
    /// Cost: O(rows).
    #[must_use]
    pub fn take<T: Borrow<ResultRow>>(self, rows: Vec<T>) -> Part<T> {
        let image = |row: &ResultRow| (row.scene_id, row.im_id);
        let mut ranks: HashMap<(u32, u32), usize> = HashMap::new();
        let mut counts: Vec<u64> = Vec::new();
        let mut contiguous = true;
        let mut last = None;
        for row in rows.iter().map(Borrow::borrow) {
            let rank = *ranks.entry(image(row)).or_insert(counts.len());
            if rank == counts.len() {
                counts.push(0);
            } else {
                contiguous &= last == Some(rank);
            }
            counts[rank] += 1;
            last = Some(rank);
        }
        let (total, shards) = (rows.len() as u64, u64::from(self.count));
        let mut before = 0;
        let mine: Vec<bool> = counts
            .iter()
            .map(|count| {
                // Because before < total, the index is below the number of shards.
                let shard = before * shards / total;
                before += count;
                shard + 1 == u64::from(self.index)
            })
            .collect();
        let rows = rows.into_iter();
        Part {
            rows: rows
                .filter(|row| mine[ranks[&image(row.borrow())]])
                .collect(),
            contiguous,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use hybrid_icp::core::Isometry3;

    fn rows(images: &[u32]) -> Vec<ResultRow> {
        let row =
            |(index, im_id): (u32, &u32)| ResultRow::new(1, *im_id, index, Isometry3::identity());
        (0..).zip(images).map(row).collect()
    }

    fn parts(images: &[u32], count: u32) -> Vec<Vec<(u32, u32)>> {
        let part = |index| Shard { index, count }.take(rows(images)).rows;
        let key = |row: &ResultRow| (row.im_id, row.obj_id);
        (1..=count)
            .map(|i| part(i).iter().map(key).collect())
            .collect()
    }

    #[test]
    fn concatenated_shards_are_the_file() {
        let images = [5, 5, 5, 2, 2, 9, 1, 1, 1, 1, 7];
        let whole = parts(&images, 1).concat();
        assert_eq!(whole.len(), images.len());
        for count in 2..15 {
            let parts = parts(&images, count);
            assert_eq!(parts.concat(), whole, "{count}");
        }
        // The sizes are as equal as whole images allow.
        let lengths: Vec<usize> = parts(&images, 2).iter().map(Vec::len).collect();
        assert_eq!(lengths, [6, 5]);
        assert!(Shard { index: 1, count: 1 }.take(rows(&images)).contiguous);
        assert!(parts(&[], 3).concat().is_empty());
    }

    #[test]
    fn images_with_scattered_rows_stay_whole() {
        let images = [5, 2, 5, 9, 2, 5, 1];
        assert!(!Shard { index: 1, count: 1 }.take(rows(&images)).contiguous);
        for count in 2..6 {
            let parts = parts(&images, count);
            for image in [5, 2, 9, 1] {
                let holders = parts.iter().filter(|p| p.iter().any(|row| row.0 == image));
                assert_eq!(holders.count(), 1);
            }
            let mut all = parts.concat();
            all.sort_by_key(|row| row.1);
            assert_eq!(all, self::parts(&images, 1).concat());
        }
    }

    #[test]
    fn only_existing_parts_are_parsed() {
        assert_eq!("2/8".parse(), Ok(Shard { index: 2, count: 8 }));
        assert_eq!("2/8".parse::<Shard>().unwrap().to_string(), "2/8");
        for bad in [
            "0/2", "3/2", "1", "1/0", "a/2", "1/2/3", "-1/2", "", "1 / 2",
        ] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
