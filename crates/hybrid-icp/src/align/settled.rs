//! The end of a registration of clouds of any size.

use hicp_core::{Correspondences, Iteration, Vector3};
use hicp_icp::{Judgment, Progress, SmallMotion, StopRule};

/// Shares of the RMS radius of the paired points between which the limit of a shift lies.
///
/// Smaller shifts may never end: pairs flip back and forth. Larger ones are errors.
const SHARES: [f64; 2] = [3e-5, 3e-3];

/// Ends a stage as [`SmallMotion`] does, with a limit of the shift that suits clouds of any size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settled;

impl StopRule for Settled {
    fn check(&mut self, iteration: &Iteration<'_>, progress: &Progress<'_>) -> Judgment {
        let usual = SmallMotion::default();
        let [low, high] = SHARES.map(|share| share * radius(progress.pairs));
        let mut limit = SmallMotion {
            translation_meters: usual.translation_meters.max(low).min(high),
            ..usual
        };
        limit.check(iteration, progress)
    }

    fn name(&self) -> &'static str {
        "motion"
    }
}

/// Returns the RMS distance of the source points of the pairs from their mean, meters.
#[allow(clippy::cast_precision_loss)] // Counts far below 2⁵³.
fn radius(pairs: &Correspondences) -> f64 {
    let count = pairs.len() as f64;
    let points = || {
        pairs
            .iter()
            .map(|pair| pair.source.point.coords.cast::<f64>())
    };
    let mean = points().sum::<Vector3<f64>>() / count;
    let squares: f64 = points().map(|point| (point - mean).norm_squared()).sum();
    (squares / count).sqrt()
}
