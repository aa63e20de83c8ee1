//! Rejection of a share that depends on the distances.

use hicp_core::internal::Scratch;
use hicp_core::{Correspondences, Iteration};

use crate::filter::max_distance::keep_within;
use crate::filter::outlier_filter::OutlierFilter;
use crate::filter::quantile::distances::{collect_finite, share_of};

/// Keeps the closest share f of the pairs, with the f that minimizes the fractional RMSD.
///
/// Source: Phillips, Liu & Tomasi 2007. FRMSD(f) = f^−λ·√(Σ of the f·n smallest d² / (f·n)) is
/// evaluated at f = i/n between `min_keep` and `max_keep`, so the overlap need not be known. Of
/// equally good shares, the largest is used. Ties with the largest kept distance are kept, too, so
/// equal distances are all kept. Pairs whose distance is not finite are removed. Cost: O(n log n)
/// for n pairs.
#[derive(Clone, Debug, PartialEq)]
pub struct VarTrimmed {
    /// Smallest share to consider, clamped to 0 … 1, and at least one pair. NaN counts as 0.
    pub min_keep: f64,
    /// Largest share to consider, clamped to `min_keep` … 1. NaN counts as 0.
    pub max_keep: f64,
    /// Exponent λ: a larger value keeps more pairs. NaN keeps the largest share.
    pub lambda: f64,
    distances: Scratch<Vec<f32>>,
}

impl VarTrimmed {
    /// Creates the filter.
    #[must_use]
    pub fn new(min_keep: f64, max_keep: f64, lambda: f64) -> Self {
        Self {
            min_keep,
            max_keep,
            lambda,
            distances: Scratch::default(),
        }
    }
}

impl Default for VarTrimmed {
    /// Shares from 5 % to 99 %, with λ = 0.95 as Phillips et al. recommend for three dimensions.
    fn default() -> Self {
        Self::new(0.05, 0.99, 0.95)
    }
}

impl OutlierFilter for VarTrimmed {
    fn filter(&mut self, _iteration: &Iteration<'_>, pairs: &mut Correspondences) {
        let distances = &mut self.distances.0;
        collect_finite(pairs, distances);
        distances.sort_unstable_by(f32::total_cmp);
        let n = distances.len();
        let fewest = share_of(self.min_keep, n).max(1);
        let most = share_of(self.max_keep, n).max(fewest);
        let mut sum = 0.0;
        let mut best = (f64::INFINITY, f32::NAN);
        for (kept, distance) in (1..).zip(distances.iter().take(most)) {
            sum += f64::from(*distance).powi(2);
            if kept >= fewest {
                let fraction = kept as f64 / n as f64;
                let rmsd = (sum / kept as f64).sqrt() * fraction.powf(-self.lambda);
                // Rounding must not separate equal values. A NaN is never better, but if all are
                // NaN, the last one is used.
                if rmsd <= best.0 * (1.0 + 1e-12) || rmsd.is_nan() {
                    best = (rmsd.min(best.0), *distance);
                }
            }
        }
        keep_within(pairs, best.1);
    }

    fn name(&self) -> &'static str {
        "var-trimmed"
    }
}
