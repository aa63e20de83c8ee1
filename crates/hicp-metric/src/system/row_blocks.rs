//! Normal equations of pairs with one residual row each, many pairs at a time.

use hicp_core::internal::{VectorLoop, vectorized};
use hicp_core::{Pair, Point3, Vector3};

use crate::system::moments::Moments;
use crate::system::normal_equations::NormalEquations;
use crate::system::pair_block::{BLOCK, LANES, add_products};
use crate::system::row_sums::RowSums;

/// Number of sums over the lower triangle of a aᵀ, where a has seven numbers.
const TRIANGLE: usize = 28;

/// The row of one pair: its residual changes by `direction` · (displacement of `point`).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) point: Point3<f64>,
    pub(crate) direction: Vector3<f64>,
    pub(crate) residual: f64,
}

impl Row {
    /// Adds the row with the weight of its pair.
    #[inline(always)]
    pub(crate) fn add_to(&self, system: &mut NormalEquations, pair: &Pair) {
        let weight = f64::from(pair.weight);
        system.add_row(&self.point, &self.direction, self.residual, weight);
    }
}

/// Returns the system of a metric with one row per pair.
///
/// Up to rounding it equals the provided
/// [`ErrorMetric::linearize_all`](crate::ErrorMetric::linearize_all), in half the time, because
/// rows lie across the lanes of vectors instead of along them.
pub(crate) fn system_of_rows(
    pairs: &[Pair],
    row: impl Fn(&Pair) -> Row,
) -> Option<NormalEquations> {
    vectorized(SumBlocks { pairs, row })
}

struct SumBlocks<'a, F> {
    pairs: &'a [Pair],
    row: F,
}

impl<F: Fn(&Pair) -> Row> VectorLoop for SumBlocks<'_, F> {
    type Output = Option<NormalEquations>;

    #[inline(always)]
    fn run(self) -> Option<NormalEquations> {
        let first = Moments::about_first(self.pairs)?;
        let origin = first.origin;
        let mut moments = BlockMoments::new(first);
        let mut sums = [[0.0; LANES]; TRIANGLE];
        let mut rows = 0;
        for pairs in self.pairs.chunks(BLOCK) {
            // p, d and r of each pair. Unused lanes have no weight.
            let (mut point, mut a) = ([[0.0; BLOCK]; 3], [[0.0; BLOCK]; 7]);
            let mut weight = [0.0; BLOCK];
            for (lane, pair) in pairs.iter().enumerate() {
                let row = (self.row)(pair);
                for axis in 0..3 {
                    point[axis][lane] = row.point[axis] - origin[axis];
                    a[axis][lane] = row.direction[axis];
                }
                a[6][lane] = row.residual;
                weight[lane] = f64::from(pair.weight);
                rows += usize::from(pair.weight > 0.0);
            }
            // (p − origin) × d
            for lane in 0..BLOCK {
                a[3][lane] = point[1][lane] * a[2][lane] - point[2][lane] * a[1][lane];
                a[4][lane] = point[2][lane] * a[0][lane] - point[0][lane] * a[2][lane];
                a[5][lane] = point[0][lane] * a[1][lane] - point[1][lane] * a[0][lane];
            }
            moments.add_block(&point, &weight);
            let mut index = 0;
            for column in 0..7 {
                let mut weighted = [0.0; BLOCK];
                for lane in 0..BLOCK {
                    weighted[lane] = weight[lane] * a[column][lane];
                }
                for line in &a[column..] {
                    add_products(&mut sums[index], &weighted, line);
                    index += 1;
                }
            }
        }
        let mut totals = sums.iter().map(|lanes| lanes.iter().sum());
        let sums = RowSums::from_triangle(std::array::from_fn(|_| totals.next().unwrap_or(0.0)));
        NormalEquations::from_sums(origin, sums, rows).centered(&moments.total())
    }
}

/// The moments of the points of rows, summed in lanes.
struct BlockMoments {
    about: Moments,
    sums: [[f64; LANES]; 4],
    squares: [[f64; LANES]; 3],
}

impl BlockMoments {
    fn new(about: Moments) -> Self {
        Self {
            about,
            sums: [[0.0; LANES]; 4],
            squares: [[0.0; LANES]; 3],
        }
    }

    #[inline(always)]
    fn add_block(&mut self, point: &[[f64; BLOCK]; 3], weight: &[f64; BLOCK]) {
        let weights = weight.as_chunks::<LANES>().0;
        let sums = self.sums.iter_mut().zip(&mut self.squares);
        for ((sum, square), values) in sums.zip(point) {
            for (weight, value) in weights.iter().zip(values.as_chunks::<LANES>().0) {
                for lane in 0..LANES {
                    let weighted = weight[lane] * value[lane];
                    sum[lane] += weighted;
                    square[lane] += weighted * value[lane];
                }
            }
        }
        for weight in weights {
            for (sum, weight) in self.sums[3].iter_mut().zip(weight) {
                *sum += weight;
            }
        }
    }

    fn total(&self) -> Moments {
        let sum = |lanes: &[f64; LANES]| lanes.iter().sum();
        let squares: [f64; 3] = std::array::from_fn(|axis| sum(&self.squares[axis]));
        self.about
            .with_sums(std::array::from_fn(|i| sum(&self.sums[i])), squares)
    }
}
