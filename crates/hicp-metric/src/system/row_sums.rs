//! Sums over weighted residual rows.

use hicp_core::{Matrix6, Vector6};

/// Columns of a row, padded to whole vectors: six of J, the residual, and a zero.
const LANES: usize = 8;
/// The position of the residual in a row.
const RESIDUAL: usize = 6;

/// The sums Σ w a aᵀ over rows a = [J, r]: JᵀWJ, JᵀWr and rᵀWr in one matrix.
///
/// Only the lower triangle counts. `0[j][i]` is the entry of line i and column j, so that adding a
/// row is the same operation on whole vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RowSums([[f64; LANES]; RESIDUAL + 1]);

impl RowSums {
    pub(crate) fn zeros() -> Self {
        Self([[0.0; LANES]; RESIDUAL + 1])
    }

    /// Creates sums from the lower triangle of a aᵀ, column by column.
    pub(crate) fn from_triangle(triangle: [f64; 28]) -> Self {
        let mut sums = Self::zeros();
        let mut triangle = triangle.into_iter();
        for (column, sums) in sums.0.iter_mut().enumerate() {
            for (sum, value) in sums[column..=RESIDUAL].iter_mut().zip(&mut triangle) {
                *sum = value;
            }
        }
        sums
    }

    /// Adds a row.
    #[inline(always)]
    pub(crate) fn add_row(&mut self, jacobian: [f64; 6], residual: f64, weight: f64) {
        let [a, b, c, d, e, f] = jacobian;
        let row = [a, b, c, d, e, f, residual, 0.0];
        for (column, sums) in self.0.iter_mut().enumerate() {
            let weighted = weight * row[column];
            // Whole vectors of four. The lines above the diagonal's vector are never read.
            for line in column / 4 * 4..LANES {
                sums[line] += weighted * row[line];
            }
        }
    }

    /// Adds to rᵀWr as a row does.
    #[inline(always)]
    pub(crate) fn add_loss(&mut self, residual: f64, weight: f64) {
        self.0[RESIDUAL][RESIDUAL] += weight * residual * residual;
    }

    /// Adds to every sum.
    pub(crate) fn add(&mut self, hessian: &Matrix6<f64>, gradient: &Vector6<f64>, loss: f64) {
        for (column, sums) in self.0[..RESIDUAL].iter_mut().enumerate() {
            for line in column..RESIDUAL {
                sums[line] += hessian[(line, column)];
            }
            sums[RESIDUAL] += gradient[column];
        }
        self.0[RESIDUAL][RESIDUAL] += loss;
    }

    /// Multiplies every sum.
    pub(crate) fn scale(&mut self, factor: f64) {
        for sum in self.0.as_flattened_mut() {
            *sum *= factor;
        }
    }

    /// Returns JᵀWJ, both triangles.
    pub(crate) fn hessian(&self) -> Matrix6<f64> {
        Matrix6::from_fn(|line, column| self.0[line.min(column)][line.max(column)])
    }

    /// Returns JᵀWr.
    pub(crate) fn gradient(&self) -> Vector6<f64> {
        Vector6::from_fn(|column, _| self.0[column][RESIDUAL])
    }

    /// Returns rᵀWr.
    pub(crate) fn loss(&self) -> f64 {
        self.0[RESIDUAL][RESIDUAL]
    }

    /// Returns the sum of the diagonal of JᵀWJ.
    pub(crate) fn trace(&self) -> f64 {
        (0..RESIDUAL).map(|i| self.0[i][i]).sum()
    }
}
