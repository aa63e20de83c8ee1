//! One pair per observed point.

use hicp_core::internal::Scratch;
use hicp_core::{Correspondences, Iteration, Pair};

use crate::filter::outlier_filter::OutlierFilter;

/// Keeps for every observed point the pair with the closest model point.
///
/// Source: Zinßer, Schmidt & Niemann 2003, Picky ICP. Model points without a counterpart share the
/// targets of others, and the closest one is most likely right. Of equally close ones, the first is
/// kept. The order of the pairs does not change. Pairs whose distance is not finite are removed.
/// Targets that are not surfels of the observation ([`Pair::UNLISTED`]) count as different.
/// Cost: O(n log n) for n pairs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OneToOne {
    scratch: Scratch<Buffers>,
}

#[derive(Debug, Default)]
struct Buffers {
    /// Target, distance and position of every pair.
    claims: Vec<(u32, f32, usize)>,
    kept: Vec<bool>,
}

impl OneToOne {
    /// Creates the filter.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}

impl OutlierFilter for OneToOne {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let Buffers { claims, kept } = &mut self.scratch.0;
        claims.clear();
        claims.extend(
            (pairs.as_slice().iter().enumerate())
                .map(|(position, pair)| (pair.target_index, pair.distance(), position))
                .filter(|(_, distance, _)| distance.is_finite()),
        );
        claims.sort_unstable_by(|a, b| {
            (a.0.cmp(&b.0))
                .then_with(|| a.1.total_cmp(&b.1))
                .then_with(|| a.2.cmp(&b.2))
        });
        claims.dedup_by(|a, b| a.0 == b.0 && a.0 != Pair::UNLISTED);
        kept.clear();
        kept.resize(pairs.len(), false);
        for (_, _, position) in claims {
            kept[*position] = true;
        }
        let mut kept = kept.iter();
        pairs.retain(|_| kept.next() == Some(&true));
    }

    fn name(&self) -> &'static str {
        "one-to-one"
    }
}
