//! Random subsets.

use hicp_core::{Context, Isometry3, Problem, Surfel};

use crate::selection::all_samples::AllSamples;
use crate::selection::point_selection::PointSelection;

/// Keeps `count` points of another selection, drawn at random without replacement.
///
/// Source: Masuda, Sakaue & Yokoya 1996. Every subset is equally likely, and the order of the inner
/// selection does not change (selection sampling, Knuth, TAOCP 2, §3.4.2, algorithm S). The draw
/// depends only on the seed and the number of points, so a stage that runs again draws the same
/// points. Give the stages of a pipeline different seeds. If there are at most `count` points, all
/// are kept. Cost: the inner selection, and O(points).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RandomSample<P> {
    /// The selection to select from.
    pub selection: P,
    /// Number of points to keep.
    pub count: usize,
    /// Seed of the draw, any value.
    pub seed: u64,
}

impl Default for RandomSample<AllSamples> {
    /// 500 of the model's samples.
    fn default() -> Self {
        Self {
            selection: AllSamples,
            count: 500,
            seed: 0,
        }
    }
}

impl<P: PointSelection> PointSelection for RandomSample<P> {
    fn select(
        &mut self,
        context: &mut Context<'_>,
        camera_from_object: &Isometry3<f64>,
        source: &mut Vec<Surfel>,
    ) {
        self.selection.select(context, camera_from_object, source);
        let mut random = SplitMix64(self.seed);
        let (mut left, mut wanted) = (source.len() as u64, self.count as u64);
        source.retain(|_| {
            // Each point is selected with probability wanted/left. Once left = wanted, all are.
            let take = random.below(left) < wanted;
            left -= 1;
            if take {
                wanted -= 1;
            }
            take
        });
    }

    fn name(&self) -> &'static str {
        "random-sample"
    }

    fn unsupported(&self, problem: &Problem<'_>) -> Option<&'static str> {
        self.selection.unsupported(problem)
    }
}

/// The generator of Steele, Lea & Flood, "Fast splittable pseudorandom number generators", OOPSLA
/// 2014.
///
/// The n-th output is a hash of seed + n·γ.
struct SplitMix64(u64);

impl SplitMix64 {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number below `n`, each with the same probability to within n/2⁶⁴.
    fn below(&mut self, n: u64) -> u64 {
        #[allow(clippy::cast_possible_truncation)] // The high half of a 128-bit product.
        let high = ((u128::from(self.next()) * u128::from(n)) >> 64) as u64;
        high
    }
}
