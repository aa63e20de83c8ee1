//! Blocks of pairs, for loops over the lanes of vectors.

use hicp_core::Pair;

/// Pairs per block. Intermediate values stay in the innermost cache, and sums are loaded once per
/// block.
pub(crate) const BLOCK: usize = 32;
/// Partial sums per sum.
pub(crate) const LANES: usize = 4;

/// One number per pair of a block.
pub(crate) type Column = [f64; BLOCK];

/// The coordinates of up to [`BLOCK`] pairs, in one array each. Unused lanes have no weight.
#[derive(Clone, Copy)]
pub(crate) struct PairBlock {
    pub(crate) source: [[f32; BLOCK]; 3],
    pub(crate) target: [[f32; BLOCK]; 3],
    pub(crate) weight: [f32; BLOCK],
}

impl PairBlock {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            source: [[0.0; BLOCK]; 3],
            target: [[0.0; BLOCK]; 3],
            weight: [0.0; BLOCK],
        }
    }

    /// Replaces the content by at most [`BLOCK`] pairs.
    #[inline(always)]
    pub(crate) fn fill(&mut self, pairs: &[Pair]) {
        for (lane, pair) in pairs.iter().take(BLOCK).enumerate() {
            for axis in 0..3 {
                self.source[axis][lane] = pair.source.point[axis];
                self.target[axis][lane] = pair.target.point[axis];
            }
            self.weight[lane] = pair.weight;
        }
        for weight in self.weight.iter_mut().skip(pairs.len()) {
            *weight = 0.0;
        }
    }
}

/// Adds Σ a b over a block to the lanes of a sum.
#[inline(always)]
pub(crate) fn add_products(sum: &mut [f64; LANES], a: &Column, b: &Column) {
    // With a local sum and offsets, the compiler uses half of the instructions that zipped chunks
    // need.
    let mut total = *sum;
    for first in (0..BLOCK).step_by(LANES) {
        for lane in 0..LANES {
            total[lane] += a[first + lane] * b[first + lane];
        }
    }
    *sum = total;
}

/// Returns the product of two columns.
#[inline(always)]
pub(crate) fn product(a: &Column, b: &Column) -> Column {
    let mut product = [0.0; BLOCK];
    for lane in 0..BLOCK {
        product[lane] = a[lane] * b[lane];
    }
    product
}

/// Adds a column to the lanes of a sum.
#[inline(always)]
pub(crate) fn add(sum: &mut [f64; LANES], column: &Column) {
    for column in column.as_chunks::<LANES>().0 {
        for lane in 0..LANES {
            sum[lane] += column[lane];
        }
    }
}
